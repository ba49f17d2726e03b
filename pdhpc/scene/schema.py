"""The scene: every key with its meaning, unit and source. The rules between keys stand in rules.py."""
import math
from typing import Annotated, List, Literal, Optional

from pydantic import PrivateAttr, model_validator

from pdhpc.scene.contact import Contact, Impactor
from pdhpc.scene.cracks import Crack
from pdhpc.scene.fields import (
    AutoOrPositive, Filled, Flag, Fraction, Listed, Name, Names, NotNegative, Number, Numbers, Positive, Share, Table, Text, Vector, Whole, key, show,
)
from pdhpc.scene.loads import ABOUT_AXIS, Z_AXIS, Initial, Load
from pdhpc.scene.methods import ACTIVATION, TOLERANCE, Fem, Gfem, Mesh, Static
from pdhpc.scene.shapes import Body, Fine, Region

FINITE_SAFETY = 0.65  # share of the critical step at which coupled regions are safe in finite deformations (see README)
GFEM_SAFETY = 0.75  # share of the critical step of the lumped mesh that model = "gfem" takes
STANDING = {"relaxation": 100_000, "newton": 30}  # methods by which a body stands still, and the most iterations in an equilibrium unless the scene says
FRAMES = 20  # frames when the scene does not say when
POISSONS_RATIO = {"plane_stress": 1 / 3, "plane_strain": 1 / 4, "3d": 1 / 4}
COMPONENTS = {
    2: {"vector": ["_x", "_y"], "tensor": ["_xx", "_yy", "_xy"], "scalar": [""]},
    3: {"vector": ["_x", "_y", "_z"], "tensor": ["_xx", "_yy", "_zz", "_xy", "_xz", "_yz"], "scalar": [""]},
}
KIND = {
    **dict.fromkeys(("displacement", "velocity", "force_density", "reaction"), "vector"), **dict.fromkeys(("stress", "strain"), "tensor"), "damage": "scalar",
}
FieldName = Literal["displacement", "velocity", "damage", "precrack", "force_density", "stress", "strain", "strain_energy_density", "active", "fragment"]


class Particles(Table):
    """How bodies are filled with particles, and what joins them."""

    spacing: Positive = key("distance h between neighbouring particles of the lattice; of bodies from files, the size of particles that volume_correction goes by", "m")
    horizon: Positive = key("distance delta up to which particles are bonded, at least 2 spacings", "m")
    thickness: Optional[Positive] = key("thickness of a 2D body (default 1); none in 3D", "m", default=None)
    influence: Literal["constant", "inverse_distance", "gaussian", "conical"] = key(
        "influence function omega of the bond length r", "", "omega = 1, delta/r, exp(-(r/delta)^2), 1 - r/delta", default="constant")
    volume_correction: Literal["linear", "none"] = key(
        "partial volumes at the horizon's edge", "", "beta = min(1, (delta + h/2 - r)/h), families up to delta + h/2; beta = 1 and families within delta with the conical influence; Seleson & Littlewood 2016", default="linear")
    surface_correction: Literal["none", "energy", "volume"] = key(
        "factor lambda of the micromodulus of bonds whose families lack a part, from the families before pre-cracks; pmb only: the weighted volumes of lps count "
        "the neighbours that are there", "",
        "energy: (sum_d (n_d/s_d)^2)^(-1/2), s_d the mean of both ends' W_bulk/W under a unit extension along d (Madenci & Oterkus 2014), taken four times over; "
        "volume: 2 V0/(V_i + V_j), V family volumes, V0 the bulk's (Le & Bobaru 2018), too stiff along surfaces", default="none")
    kinematics: Literal["finite", "linear"] = key(
        "stretch of a bond xi with relative displacement eta: of its deformed length, or linearised", "",
        "s = |xi + eta|/|xi| - 1, or xi.eta/|xi|^2; Silling & Askari 2005", default="finite")
    path: Literal["auto", "lattice", "cloud"] = key(
        "how bonds are stored: as a stencil with a bit each, where all bodies lie on one lattice, or as lists of neighbours; the same model", default="auto")


class Material(Table):
    """A material; several may share a scene."""

    name: Name = key("name of the material")
    model: Literal["pmb", "lps", "elastic"] = key(
        "pmb: bond-based prototype microelastic brittle material; lps: state-based linear peridynamic solid, of any Poisson's ratio; elastic: Hooke's law, for "
        "finite elements alone", "", "Silling 2000; Silling & Askari 2005; Silling et al. 2007; Le, Chan & Schwartz 2014", default="pmb")
    density: Positive = key("mass density", "kg/m^3")
    youngs_modulus: Optional[Positive] = key(
        "Young's modulus E", "Pa", "pmb: c = 12 E/(pi delta^4) in 3D, 9 E/(pi t delta^3) in plane stress, 48 E/(5 pi t delta^3) in plane strain", default=None)
    poissons_ratio: Optional[Number] = key(
        "Poisson's ratio, -1 to 1/2; fixed by pmb: 1/4 in 3D and plane strain, 1/3 in plane stress", "1", "Silling 2000", default=None)
    bulk_modulus: Optional[Positive] = key("bulk modulus K (of 3D) of lps and elastic, in the place of E and nu", "Pa", "K = E/(3 (1 - 2 nu))", default=None)
    shear_modulus: Optional[Positive] = key("shear modulus G of lps and elastic, in the place of E and nu", "Pa", "G = E/(2 (1 + nu))", default=None)
    energy_release_rate: Optional[Positive] = key(
        "energy G per crack area; sets the critical stretch", "J/m^2",
        "pmb: s0 = sqrt(5 G/(6 E delta)) in 3D, sqrt(4 pi G/(9 E delta)) in plane stress, sqrt(5 pi G/(12 E delta)) in plane strain, constant influence; "
        "lps: see check", default=None)
    critical_stretch: Optional[Positive] = key("stretch s0 at which a bond breaks; neither this nor energy_release_rate: bonds never break", "1", default=None)
    failure: Literal["stretch", "energy"] = key(
        "stretch: a bond breaks beyond s0; energy: when, stretched, it stores the energy density w_c", "",
        "w_c = 4 G/(pi delta^4) in 3D, 3 G/(2 t delta^3) in 2D; pmb: s0(r) = sqrt(2 w_c/(c omega r)), lps: w = omega r^2 s (C s + P)/2; Foster, Silling & Chen 2011",
        default="stretch")
    stretch_softening: NotNegative = key(
        "alpha: the critical stretch of a particle rises with its most compressed bond; a bond has the lower one of both ends; costs a sweep and a message a step", "1",
        "s0_i = s0 - alpha min(0, s_min,i); Silling & Askari 2005, typically 0.25", default=0.0)
    weibull_modulus: Optional[Positive] = key(
        "m: critical stretches scatter, as flaws do; a bond has the lower one of both ends; none: all are s0", "1",
        "P(s < x) = 1 - exp(-(x Gamma(1 + 1/m)/s0)^m), of mean s0 and coefficient of variation about 1.2/m; Weibull 1951; Zhou & Molinari 2004", default=None)
    weibull_length: Optional[Positive] = key(
        "size of the grains that have one critical stretch each, the same at any spacing; without it each particle has its own, and families average", "m",
        "Voronoi cells of a random point in each square or cube of this side", default=None)
    weibull_seed: Optional[Whole] = key(
        "picks one of the bodies that scatter so (default 1): strengths are hashes of it and of places or ids, the same on any number of ranks", "1", default=None)


class Interface(Table):
    """How two bodies hold together."""

    bodies: Names = key("names of the two bodies")
    bonds: Literal["glued", "none"] = key(
        "glued: particles of both within the mean of the horizons are bonded, as they are without this table; none: no bonds", "",
        "micromodulus: harmonic mean of both materials' at that horizon; critical stretch: the smaller one at it", default="glued")


class Damage(Table):
    """Where bonds may break."""

    no_fail: Names = key("regions whose particles' bonds never break", default=[])


class TimeSpan(Table):
    """Time integration by velocity Verlet: one step for all, or each region at its own."""

    end: Positive = key("end of the run", "s")
    dt: AutoOrPositive = key(
        'time step, with a fine region that of the rest; "auto": safety times the critical step', "s",
        "dt_c = sqrt(2 min rho/|A|), A = sum c omega beta V/|xi| e (x) e (bound on the assembled bonds)", default="auto")
    safety: Share = key('share of the critical step that auto takes, at most 1; with model = "gfem" 0.75 by default and at most 0.8', "1", default=0.9)
    method: Literal["auto", "single", "mts", "subcycling", "micro", "relaxation", "newton"] = key(
        "relaxation, newton: the body stands still in equilibrium at each load step, see [static]; single: one step for the whole body; mts: the fine region at its own step, coupled by multipliers; for comparison subcycling: at its own step, with "
        "ghosts in between interpolated, and micro: multipliers at each of its steps; auto: mts with a fine region, single without", "",
        "Lindsay, Parks & Prakash 2016; Gravouil & Combescure 2001; Kilic & Madenci 2010", default="auto")
    error: Positive = key('share of the phase of the shortest resolved wave that the fine region may lose per radian, for step_ratio = "auto"', "1", default=1e-3)
    allow_unstable: Flag = key("accept a dt above the critical step", default=False)


class Output(Table):
    """What is written, and when."""

    every: Optional[Positive] = key("interval between frames of fields", "s", default=None)
    frames: Optional[Whole] = key("number of evenly spaced frames after t = 0 (default 20, unless every or times is given)", "1", default=None)
    times: Optional[Numbers] = key("times of frames, increasing", "s", default=None)
    fields: Annotated[List[FieldName], Filled] = key("fields of each frame; active: 1 where a particle moves by itself, not as elements do; fragment: lowest id in it, -1 for dust", default=["displacement", "damage"])
    history_every: Optional[Positive] = key("interval between rows of history.csv, beside those at the frames", "s", default=None)
    pictures: Flag = key("draw pictures at the end", default=True)


class Checkpoint(Table):
    """When the state of a run is saved, for pdhpc restart, beside the signals SIGUSR1 (save), SIGTERM and SIGINT (save and stop)."""

    steps: Optional[Whole] = key("save every so many steps", "1", default=None)
    minutes: Optional[Positive] = key("save when so much wall time has passed", "min", default=None)
    at_end: Flag = key("save the state of the end, so that a later end can be set", default=True)


class Probe(Table):
    """A quantity written to history.csv: at the particle nearest to a point, or over a region."""

    name: Name = key("name of the probe")
    point: Optional[Vector] = key("the particle nearest to this point", "m", default=None)
    region: Optional[Name] = key("mean over this region (sum for the reaction)", default=None)
    quantity: Literal["displacement", "velocity", "stress", "strain", "damage", "reaction", "force_density"] = key(
        "what is probed; reaction: force that holds the region", "m, m/s, Pa, 1, 1, N, N/m^3", "R = -sum V f, f the total force density")


class Curve(Table):
    """A picture of one column of history.csv over another, such as a load-displacement curve."""

    name: Name = key("name of the curve")
    x: Text = key('abscissa as "probe.component"')
    y: Text = key('ordinate as "probe.component"')


class Tip(Table):
    """A crack tip to follow: the foremost damaged particle along a direction."""

    name: Name = key("name of the tip")
    direction: Optional[Vector] = key("direction of growth, of any length (default x)", "1", default=None)
    region: Name = key("region the tip is looked for in", default="all")
    threshold: Fraction = key("damage grown since the start that counts as cracked", "1", default=0.35)
    window: Positive = key("time over which the speed is averaged", "s", default=1e-6)


class Fragments(Table):
    """Count what holds together by intact bonds."""

    damage: Fraction = key("damage grown since the start beyond which a particle belongs to no fragment: it is dust", "1", default=0.35)
    particles: Whole = key("least number of particles of a fragment; smaller ones are dust", "1", default=10)


class SceneError(ValueError):
    """Bad input: one sentence with file, key, what was found and what is allowed; `where` is the key, as the sentence names it."""

    def __init__(self, sentence, where=""):
        super().__init__(sentence)
        self.where = where


class Scene(Table):
    """A scene: what is simulated. SI units throughout."""

    title: Text = key("title of the run", default="")
    model: Literal["particles", "fem", "gfem"] = key(
        "particles: peridynamics; fem: linear elasticity by finite elements; gfem: finite elements, enriched by local particles where the material fails",
        default="particles")
    dimension: Literal["plane_stress", "plane_strain", "3d"] = key("dimension of the body")
    particles: Optional[Particles] = key("particles; finite elements alone need none, unless fem.moduli = \"lattice\"", default=None)
    mesh: Optional[Mesh] = key("mesh of the finite elements", default=None)
    fem: Optional[Fem] = key("finite elements", default=None)
    gfem: Optional[Gfem] = key("finite elements enriched by local particles", default=None)
    material: Annotated[List[Material], Filled] = key("materials")
    body: Annotated[List[Body], Filled] = key("bodies")
    interface: Annotated[List[Interface], Listed] = key("pairs of bodies and whether bonds join them", default=[])
    region: Annotated[List[Region], Listed] = key("named sets of particles", default=[])
    crack: Annotated[List[Crack], Listed] = key("pre-cracks: bonds that cross them are cut at the start", default=[])
    contact: Optional[Contact] = key("contact between particles that are not bonded; none without this table", default=None)
    impactor: Annotated[List[Impactor], Listed] = key("rigid bodies that particles cannot enter", default=[])
    fine: Optional[Fine] = key("region that takes smaller steps than the rest", default=None)
    damage: Damage = key("where bonds may break", default=Damage())
    load: Annotated[List[Load], Listed] = key("loads and prescribed motions", default=[])
    initial: Annotated[List[Initial], Listed] = key("initial states", default=[])
    time: TimeSpan = key("time integration")
    static: Optional[Static] = key("load steps of bodies that stand still", default=None)
    output: Output = key("output", default=Output())
    checkpoint: Optional[Checkpoint] = key("when the state is saved; without this table on signals alone", default=None)
    probe: Annotated[List[Probe], Listed] = key("probes", default=[])
    curve: Annotated[List[Curve], Listed] = key("curves drawn from probes", default=[])
    tip: Annotated[List[Tip], Listed] = key("crack tips to follow", default=[])
    fragments: Optional[Fragments] = key("fragments to count", default=None)
    _source: str = PrivateAttr(default="scene")

    @model_validator(mode="before")
    @classmethod
    def _open_sections(cls, data):
        """Give a scene the tables [fem], [gfem] and [static] of its model and method, where it leaves them out."""
        if not isinstance(data, dict):
            return data
        model, time = data.get("model"), data.get("time")
        needed = {"fem": ("fem",), "gfem": ("fem", "gfem")}.get(model, ()) if isinstance(model, str) else ()
        if isinstance(time, dict) and time.get("method") in list(STANDING):
            needed += ("static",)
        return {**{name: {} for name in needed}, **data}

    @property
    def uses_mesh(self):
        """Whether finite elements take part."""
        return self.model != "particles"

    @property
    def uses_lattice(self):
        """Whether the lattice of particles takes part, if only through its moduli."""
        return self.model != "fem" or self.moduli == "lattice"

    @property
    def from_file(self):
        """Whether the bodies are those of a mesh from a file."""
        return self.uses_mesh and self.mesh.file is not None

    @property
    def brings_points(self):
        """Whether bodies are made of particles that stand in files."""
        return any(body.file is not None for body in self.body)

    @property
    def files(self):
        """Sorted names of the files that make the bodies, as the scene has them: from its own folder."""
        return sorted({each.file for each in ([self.mesh] if self.mesh is not None else []) + self.body if each.file is not None})

    @property
    def pitch(self):
        """Side of the cells that fill the bodies, m: of the lattice, or of the mesh alone."""
        return self.particles.spacing if self.uses_lattice else self.mesh.cell_size

    def spacing_of(self, body):
        """Return the spacing of a body's particles, or the side of its cells, m."""
        return self.pitch if body.spacing is None else body.spacing

    @property
    def moduli(self):
        """What the finite elements' moduli are: "continuum" or "lattice"."""
        return self.fem.moduli or ("lattice" if self.model == "gfem" else "continuum")

    @property
    def safety(self):
        """Share of the critical step that dt = "auto" takes."""
        if "safety" in self.time.model_fields_set:
            return self.time.safety
        if self.model == "gfem":
            return GFEM_SAFETY
        return FINITE_SAFETY if self.method == "mts" and self.particles.kinematics == "finite" else self.time.safety

    @property
    def dim(self):
        """2 or 3."""
        return 3 if self.dimension == "3d" else 2

    @property
    def thickness(self):
        """Thickness of a 2D body, m; 1 by default and in 3D."""
        tables = [table for table in (self.mesh if self.uses_mesh else None, self.particles) if table is not None]
        return next((table.thickness for table in tables if table.thickness is not None), 1.0)

    @property
    def method(self):
        """How time is integrated: "single", "mts", "subcycling" or "micro"."""
        if self.time.method != "auto":
            return self.time.method
        return "single" if self.fine is None else "mts"

    @property
    def stands_still(self):
        """Whether particles are brought to rest in load steps."""
        return self.model == "particles" and self.time.method in STANDING

    @property
    def load_steps(self):
        """Number of load steps of bodies that stand still."""
        if self.static.steps is not None:
            return self.static.steps
        return self.output.frames or (FRAMES if self.output.every is None else math.ceil(self.time.end / self.output.every * (1 - 1e-9)))

    @property
    def overlap(self):
        """Width of the overlap of the fine region, horizons."""
        return self.fine.overlap or (2.0 if self.material[0].model == "lps" else 1.0)

    @property
    def source(self):
        """Name of the file the scene came from."""
        return self._source

    def error(self, where, found, allowed):
        """Return the SceneError that says what was found at the key `where` and what is allowed."""
        return SceneError(f"{self._source}: {where} = {found if isinstance(found, str) else show(found)}; allowed is {allowed}", where)

    def given(self):
        """Return the scene as a dict of plain values as it was given, without defaults; read.scene_from_dict makes the same scene of it."""
        return self.model_dump(mode="json", exclude_unset=True)

    def resolved(self):
        """Return the scene as a dict of plain values with every default filled in that has a value; read.scene_from_dict takes it back."""
        data = self.model_dump(mode="json", exclude_none=True)
        if self.dim == 2:
            holder = data["particles"] if self.particles is not None else data["mesh"]
            if not self.uses_mesh or self.mesh.thickness is None:
                holder.setdefault("thickness", self.thickness)
        self._resolve_method(data)
        for material in data["material"]:
            if material["model"] == "pmb":
                material.setdefault("poissons_ratio", POISSONS_RATIO[self.dimension])
            if "weibull_modulus" in material:
                material.setdefault("weibull_seed", 1)
        if self.fine is not None:
            data["fine"].setdefault("overlap", self.overlap)
        for initial in data["initial"]:
            initial.setdefault("origin", [0.0] * self.dim)
            if self.dim == 3 and any(name in ABOUT_AXIS for name in initial):
                initial.setdefault("axis", list(Z_AXIS))
                initial.setdefault("length", 1.0)
        for tip in data["tip"]:
            tip.setdefault("direction", [1.0, 0.0, 0.0][: self.dim])
        if self.output.every is None and self.output.times is None:
            data["output"].setdefault("frames", FRAMES)
        return data

    def _resolve_method(self, data):
        """Fill in the defaults of load steps, of the share of the critical step, of the finite elements and of their coupling with particles."""
        data["time"]["safety"] = self.safety
        if self.stands_still:
            data["static"].setdefault("steps", self.load_steps)
            data["static"].setdefault("iterations", STANDING[self.time.method])
        if self.uses_mesh:
            data["fem"].setdefault("moduli", self.moduli)
        if self.model == "gfem":
            if not self.gfem.everywhere:
                data["gfem"].setdefault("activation", ACTIVATION)
            if self.gfem.scheme != "pinned":
                data["gfem"].setdefault("tolerance", TOLERANCE)

    def output_times(self):
        """Return the times of frames after t = 0, s."""
        setting = self.output
        if setting.times is not None:
            return list(setting.times)
        count = setting.frames or FRAMES
        if setting.every is not None:
            return multiples(setting.every, self.time.end)
        return [self.time.end * (number + 1) / count for number in range(count)]

    def history_times(self):
        """Return the times of rows of history.csv after t = 0, beside those of frames, s."""
        every = self.output.history_every
        if self.stands_still:
            return [self.time.end * (number + 1) / self.load_steps for number in range(self.load_steps)]
        return [] if every is None else multiples(every, self.time.end)


def multiples(interval, end):
    """Return interval, 2 interval, ... up to end."""
    return [interval * number for number in range(1, int(end / interval * (1 + 1e-9)) + 1)]
