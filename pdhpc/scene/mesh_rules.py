"""Rules of scenes with finite elements: what each model needs, what it refuses, and what it leaves unused; see rules.py."""
from pdhpc.scene.fields import Rule, show
from pdhpc.scene.sections import section
from pdhpc.scene.static_rules import unused_keys

LARGEST_SHARE = 0.8  # of the critical step of the lumped mesh, up to which the coupled step is stable
_LEAST_RATIO = 4  # spacings in a cell that particles enrich
_WHOLE = 1e-6  # of a spacing or cell: how closely lengths must be whole multiples


def check_model(scene):
    """Raise a Rule for a table or key that the scene's model needs, or has no use for where leaving it out would change what is simulated."""
    if scene.particles is None and scene.uses_lattice:
        why = f'model = "{scene.model}"' if scene.model != "fem" else 'fem.moduli = "lattice"'
        raise Rule("particles", "nothing", f"one table headed [particles]: {why} needs it")
    if scene.particles is not None and scene.dim == 3 and scene.particles.thickness is not None:
        raise Rule("particles.thickness", scene.particles.thickness, "no thickness in 3D")
    if scene.uses_mesh:
        _check_mesh(scene)
    _check_shapes(scene)
    if scene.model == "fem":
        _check_alone(scene)
    if scene.model == "gfem":
        _check_coupled(scene)
    if scene.uses_mesh:
        _check_elements(scene)
        _check_fit(scene)


def _check_mesh(scene):
    mesh = scene.mesh
    if mesh is None:
        raise Rule("mesh", "nothing", f'one table headed [mesh]: model = "{scene.model}" needs it')
    if (mesh.cell_size is None) == (mesh.file is None):
        key, found = ("cell_size", "nothing, and no file") if mesh.file is None else ("file", f"{show(mesh.file)} beside cell_size")
        raise Rule(f"mesh.{key}", found, "exactly one of cell_size and file")
    if scene.model == "gfem" and mesh.file is not None:
        raise Rule("mesh.file", f'{show(mesh.file)} with model = "gfem"', "mesh.cell_size: particles on a lattice need cells that hold whole spacings")
    if mesh.thickness is not None:
        if scene.dim == 3:
            raise Rule("mesh.thickness", mesh.thickness, "no thickness in 3D")
        if scene.particles is not None and scene.particles.thickness is not None:
            raise Rule("mesh.thickness", f"{mesh.thickness} beside particles.thickness", "one of the two, not both")


def _check_shapes(scene):
    """Raise a Rule for a body or region whose shape the mesh (or its absence) rules out, and for tractions without a face."""
    from_file = scene.from_file
    for number, body in enumerate(scene.body):
        key = f"{section('body', number, body)}: shape"
        if from_file and body.shape != "mesh":
            raise Rule(key, f'"{body.shape}"', '"mesh": mesh.file makes the bodies')
        if scene.uses_mesh and not from_file and body.shape == "mesh":
            raise Rule(key, '"mesh"', '"box", or "mesh" with model = "fem" and mesh.file')
        if scene.uses_mesh and not from_file and body.shape != "box":
            raise Rule(key, f'"{body.shape}"', '"box", or "mesh" with mesh.file: square cells fill boxes only')
    if from_file and len(scene.body) > 1:
        for number, body in enumerate(scene.body):
            if body.group is None:
                key = f"{section('body', number, body)}: group"
                raise Rule(key, "nothing beside other bodies", "the physical group of the file that holds the body's cells")
    groups = {region.name: number for number, region in enumerate(scene.region) if region.shape == "group"}
    for name, number in groups.items():
        if not from_file and (scene.uses_mesh or not scene.brings_points):
            raise Rule(f"region '{name}': shape", '"group"', '"box" or another shape: "group" goes with mesh.file, or with a body from a file')
    for number, load in enumerate(scene.load):
        if load.type == "traction" and load.face is None and (not scene.uses_mesh or load.region not in groups):
            allowed = '"+x", "-x", "+y", "-y", "+z" or "-z" (only a region of shape = "group" of finite elements needs none)'
            raise Rule(f"{section('load', number, load)}: face", "nothing", allowed)


def _check_alone(scene):
    """Raise a Rule for what finite elements alone do not know."""
    if scene.fine is not None:
        raise Rule("fine", "a table", 'none with model = "fem", which takes one step for the whole mesh')
    for key in ("crack", "tip"):
        if getattr(scene, key):
            raise Rule(key, "one or more tables", 'none with model = "fem", which knows no cracks; model = "gfem" and "particles" do')
    fem = scene.fem
    if fem.partition_of_unity == "flat_top" and (fem.integration == "explicit" or scene.from_file):
        found = '"flat_top" with ' + ('integration = "explicit"' if fem.integration == "explicit" else "mesh.file")
        raise Rule("fem.partition_of_unity", found, '"hat", or "flat_top" with integration = "newmark" or "static" and mesh.cell_size')
    if scene.moduli == "lattice" and fem.partition_of_unity == "flat_top":
        raise Rule("fem.moduli", '"lattice" with partition_of_unity = "flat_top"', '"continuum": the lattice\'s moduli are there for hats')
    if scene.moduli == "lattice" and scene.from_file:
        raise Rule("fem.moduli", '"lattice" with mesh.file', '"continuum", or mesh.cell_size: cells must hold whole spacings of the lattice')
    if fem.integration == "static":
        _check_static(scene)


def _check_static(scene):
    if scene.time.dt != "auto":
        raise Rule("time.dt", scene.time.dt, '"auto": fem.integration = "static" takes one step, to time.end')
    if scene.initial:
        raise Rule("initial", f"{len(scene.initial)} of them", 'none with fem.integration = "static", which is in equilibrium at once')
    for number, load in enumerate(scene.load):
        if load.type == "velocity":
            raise Rule(f"{section('load', number, load)}: type", '"velocity"', '"displacement" or a force: nothing moves with fem.integration = "static"')


def _check_coupled(scene):
    """Raise a Rule for what the coupling of finite elements and particles does not know."""
    gfem, fem = scene.gfem, scene.fem
    if scene.dim == 3:
        raise Rule("dimension", '"3d" with model = "gfem"', '"plane_stress" or "plane_strain": the coupled step is verified in two dimensions only')
    if scene.fine is not None:
        raise Rule("fine", "a table", 'none with model = "gfem": the particles take gfem.substeps steps in one of the mesh')
    for key, only in (("integration", "explicit"), ("partition_of_unity", "hat")):
        if getattr(fem, key) != only:
            raise Rule(f"fem.{key}", f'"{getattr(fem, key)}" with model = "gfem"', f'"{only}", which the coupled step is made for')
    if scene.particles.kinematics != "linear":
        allowed = '"linear" with model = "gfem": the elements are linear, and the coupling is not verified for finite deformations'
        raise Rule("particles.kinematics", f'"{scene.particles.kinematics}"', allowed)
    for key, unused in (("tolerance", gfem.scheme == "pinned"), ("activation", gfem.everywhere)):
        if getattr(gfem, key) is not None and unused:
            other = 'scheme = "pinned", which enriches every degree of freedom of a patch' if key == "tolerance" else "everywhere = true"
            raise Rule(f"gfem.{key}", f"{getattr(gfem, key)} with gfem.{other}", "no such key there")
    if "safety" in scene.time.model_fields_set and scene.time.safety > LARGEST_SHARE:
        raise Rule("time.safety", scene.time.safety, f'at most {LARGEST_SHARE} with model = "gfem": the coupled step was found unstable above')


def _check_elements(scene):
    """Raise a Rule for a time step or a method that finite elements do not take."""
    if scene.time.method not in ("auto", "single"):
        raise Rule("time.method", f'"{scene.time.method}" with model = "{scene.model}"', '"auto" or "single"')


def _check_fit(scene):
    """Raise a Rule unless cells, lattice, bodies and holes fit each other."""
    size = scene.mesh.cell_size
    if size is None:
        return
    if scene.uses_lattice:
        _check_ratio(scene, size)
        if scene.particles.path == "cloud":
            raise Rule("particles.path", '"cloud"', '"auto" or "lattice": the cells of a mesh hold particles of one lattice')
    corner = [min(x) for x in zip(*(body.lower for body in scene.body))]
    for number, body in enumerate(scene.body):
        where = section("body", number, body)
        _check_whole(f"{where}: upper", body.upper, body.lower, size, "a box that holds whole cells", scene)
        _check_whole(f"{where}: lower", body.lower, corner, size, "a corner whole cells away from those of the other bodies", scene)
        for index, hole in enumerate(body.hole):
            if scene.uses_lattice:
                if hole.shape != "box":
                    raise Rule(f"{where}: hole[{index}]: shape", f'"{hole.shape}"', '"box": where lattice and mesh meet, holes are whole cells')
                words = "a corner whole cells away from that of the body"
                for key in ("lower", "upper"):
                    _check_whole(f"{where}: hole[{index}]: {key}", getattr(hole, key), body.lower, size, words, scene)


def _check_ratio(scene, size):
    setting = scene.particles
    ratio = size / setting.spacing
    least = _LEAST_RATIO if scene.model == "gfem" else 1
    if abs(ratio - round(ratio)) > _WHOLE * ratio or round(ratio) < least:
        raise Rule("mesh.cell_size", size, f"a whole multiple, at least {least}, of particles.spacing = {setting.spacing:g} m (here {ratio:.6g})")
    reach = setting.horizon + setting.spacing / 2
    if scene.model == "gfem" and reach > size * (1 + 1e-9):
        raise Rule("mesh.cell_size", size, f"at least horizon + spacing/2 = {reach:g} m: a family reaches no farther than the next cell")


def _check_whole(key, found, origin, size, words, scene):
    """Raise a Rule unless a corner lies whole cells from an origin."""
    if len(found) != scene.dim or len(origin) != scene.dim:
        return  # other rules say so
    for axis, x, start in zip("xyz", found, origin):
        count = round((x - start) / size)
        if abs(x - start - count * size) > _WHOLE * size + 1e-15 * max(abs(x), abs(start)):
            raise Rule(key, found, f"{words}: in {axis} {start + count * size:.10g} m would be, mesh.cell_size = {size:g} m")


def check_material(scene, where, material):
    """Raise a Rule for a material that the scene's model does not know."""
    if material.model == "elastic":
        if scene.uses_lattice:
            allowed = '"pmb" or "lps": particles and their moduli need a peridynamic material' if scene.model == "particles" else '"pmb"'
            raise Rule(f"{where}: model", '"elastic"', allowed)
        for key in ("energy_release_rate", "critical_stretch"):
            if getattr(material, key) is not None:
                raise Rule(f"{where}: {key}", getattr(material, key), 'no such key in model = "elastic", which never fails')
    if material.model == "lps" and scene.model == "gfem":
        raise Rule(f"{where}: model", '"lps"', '"pmb": the moduli and the collar of two horizons that lps would need are not verified')
    if material.model == "lps" and scene.uses_mesh and scene.moduli == "lattice":
        raise Rule(f"{where}: model", '"lps" with fem.moduli = "lattice"', '"pmb", or fem.moduli = "continuum"')


def unused(scene):
    """Return a sentence for each table and key that the scene's model does not use and that changes nothing by it."""
    model, sentences = scene.model, unused_keys(scene)

    def leave(what, why):
        sentences.append(f"{what} is not used: {why}")

    for name in ("mesh", "fem", "gfem") if model == "particles" else ("gfem",) if model == "fem" else ():
        if getattr(scene, name) is not None:
            leave(f"[{name}]", f'model = "{model}"')
    if model == "fem":
        if scene.particles is not None and not scene.uses_lattice:
            leave("[particles]" + (" but for its thickness" if scene.particles.thickness is not None else ""), 'model = "fem" with fem.moduli = "continuum"')
        if scene.damage.no_fail:
            leave("damage.no_fail", "finite elements alone never fail")
        for material in scene.material:
            if material.energy_release_rate is not None or material.critical_stretch is not None:
                leave(f"the strength of material '{material.name}'", "finite elements alone never fail")
        if scene.fem.integration != "explicit":
            for key in {"safety", "allow_unstable"} & scene.time.model_fields_set:
                if getattr(scene.time, key) not in (False, 0.9):
                    leave(f"time.{key}", f'fem.integration = "{scene.fem.integration}" is stable at any step')
    return sentences
