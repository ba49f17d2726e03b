"""Scene -> bodies: geometry, materials and what tells the particles of a scene apart; nothing that grows with their number."""
from dataclasses import replace
from typing import List, NamedTuple, Optional

import numpy as np

from pdhpc.geometry import shapes
from pdhpc.geometry.lattice import CommonLattice, LatticeBody, find_common_lattice
from pdhpc.geometry.points import PointBody
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting, between, reach_of
from pdhpc.materials.state_based import LinearSolid
from pdhpc.scene.point_bodies import PointFiles, bit_of
from pdhpc.scene.sections import section


class Body(NamedTuple):
    """The bodies of a scene as geometry, with what tells their particles apart."""

    lattices: List[object]  # LatticeBody, or PointBody of a body from a file, as scene.body
    materials: List[object]  # BondBased or LinearSolid
    law: object  # of these materials, see materials/law.py
    blocks: dict  # (kind, may fail) -> block; kind: material number or, where Settings differ, the place in `kinds`
    kinds: list  # (material number, Setting), one for each material, or for each material with the horizon and spacing of a body
    reach: object  # family radius, m, or a table of it by the bodies of both ends, 0 for no bonds
    volumes: List[float]  # m^3, of a particle of each body, the mean one of a body from a file
    lattice: Optional[CommonLattice]  # that all bodies lie on: then the lattice path is taken
    path: str  # "lattice" or "cloud", and why
    remarks: tuple = ()  # sentences on files

    @property
    def cell_volume(self):
        """Volume of a particle of the first body, m^3."""
        return self.volumes[0]

    @property
    def spacing(self):
        """Smallest spacing of the bodies, the mean size of particles in its place where they come from a file, m."""
        return min(each.spacing for each in self.lattices)

    @property
    def brings_points(self):
        """Whether some of the bodies are PointBodies."""
        return any(isinstance(each, PointBody) for each in self.lattices)

    def number_of(self, ids):
        """Return (n,) the body of each particle, by global id."""
        return np.searchsorted(np.array([lattice.first_id for lattice in self.lattices]), ids, side="right") - 1

    def seen_through(self, window):
        """Return the Body of the particles in a window, a shape."""
        return self._replace(lattices=[replace(lattice, window=window) for lattice in self.lattices])


    def calibration(self):
        """Return ([(material, may fail)] by block, their Settings), as laws take them."""
        return _calibration(self.materials, self.kinds, self.blocks)


def radius_of(scene):
    """Return the radius of the families of a scene, m, the largest of all bodies."""
    return float(np.max(reach_between_bodies(scene)))


def reach_between_bodies(scene):
    """Return the family radius, m, or, where it is not one for all, a table (n_body, n_body) of it, 0 where an interface has no bonds."""
    settings = [setting_of(scene, body) for body in scene.body]
    distinct = list(dict.fromkeys(settings))
    kind = [distinct.index(setting) for setting in settings]
    table = np.array([[reach_of(between(one, other)) for other in distinct] for one in distinct])[np.ix_(kind, kind)]
    names = [body.name for body in scene.body]
    for interface in scene.interface:
        if interface.bonds == "none":
            one, other = (names.index(name) for name in interface.bodies)
            table[one, other] = table[other, one] = 0.0
    return float(table[0, 0]) if (table == table[0, 0]).all() else table


def make_body(scene, comm=None):
    """Return the Body of a scene; allocates nothing that grows with the number of particles. Local, but Collective over `comm` for bodies from files.

    Raises
    ------
    SceneError, on every rank: as point_bodies.PointFiles, which holds their points.
    """
    lattices, first_id = [], 0
    files = PointFiles(scene, comm) if scene.brings_points else None
    for number, body in enumerate(scene.body):
        if body.file is not None:
            lattices.append(files.body(number, first_id))
        else:
            holes = tuple(make_shape(hole) for hole in body.hole)
            lattices.append(LatticeBody(make_shape(body), scene.spacing_of(body), first_id, holes))
        first_id = lattices[-1].last_id
    materials = [_make_material(table) for table in scene.material]
    kinds, reach = kinds_of(scene), reach_between_bodies(scene)
    lattice, path = choose_path(scene, lattices, np.ndim(reach) > 0)
    return Body(lattices, materials, law_of(scene), _blocks_of(scene, kinds), kinds, reach, [each.spacing**scene.dim * scene.thickness for each in lattices], lattice, path,
                () if files is None else tuple(files.remarks()))


def law_of(scene):
    """Return the law of the materials of a scene, without reading files. Local."""
    materials, kinds = [_make_material(table) for table in scene.material], kinds_of(scene)
    return type(materials[0]).law(*_calibration(materials, kinds, _blocks_of(scene, kinds)))


def _blocks_of(scene, kinds):
    """Return {(place in kinds, may fail): block}."""
    failing = (True, False) if scene.damage.no_fail or scene.model == "gfem" else (True,)
    return {key: block for block, key in enumerate((kind, may_fail) for kind in range(len(kinds)) for may_fail in failing)}


def _calibration(materials, kinds, blocks):
    """Return Body.calibration of these materials, kinds and blocks."""
    each = [(*kinds[kind], may_fail) for kind, may_fail in blocks]
    return [(materials[number], may_fail) for number, _, may_fail in each], [setting for _, setting, _ in each]


def kinds_of(scene):
    """Return [(material number, Setting)] of the bodies, each pair once, in the order of the materials."""
    return sorted(dict.fromkeys(kinds_by_body(scene)), key=lambda kind: kind[0])


def kinds_by_body(scene):
    """Return the (material number, Setting) of each body."""
    names = [material.name for material in scene.material]
    return [(names.index(body.material), setting_of(scene, body)) for body in scene.body]


def calibration_of(scene):
    """Return the Setting that calibrates the materials of bodies without a horizon or a spacing of their own."""
    setting = scene.particles
    linear = setting.kinematics == "linear"
    return Setting(scene.dimension, setting.horizon, scene.thickness, setting.influence, setting.spacing, setting.volume_correction, linear)


def setting_of(scene, body):
    """Return the Setting that calibrates the material of a body: with its own horizon and, where weights of bonds know one, its own spacing."""
    setting = calibration_of(scene)
    if body.horizon is not None:
        setting = setting._replace(horizon=body.horizon)
    if body.spacing is not None and setting.volume_correction == "linear" and setting.influence != "conical":
        setting = setting._replace(spacing=body.spacing)
    return setting


def _make_material(table):
    """Return the material of a material table."""
    strength = table.energy_release_rate, table.critical_stretch, table.failure, table.stretch_softening, table.weibull_modulus, table.weibull_seed or 1, table.weibull_length or 0.0
    if table.model == "pmb":
        return BondBased(table.name, table.density, table.youngs_modulus, *strength)
    moduli = table.bulk_modulus, table.shear_modulus
    if table.youngs_modulus is not None:
        moduli = LinearSolid.moduli(table.youngs_modulus, table.poissons_ratio)
    return LinearSolid(table.name, table.density, *moduli, *strength)


def choose_path(scene, lattices, by_pair):
    """Return (CommonLattice or None, "lattice: why" or "cloud: why").

    lattices : of the bodies, not looked at where files make some of them. by_pair : whether family radii differ between pairs of bodies.
    """
    if scene.particles.path == "cloud":
        return None, 'cloud: asked for by particles.path = "cloud"'
    if scene.brings_points:
        number, body = next((number, body) for number, body in enumerate(scene.body) if body.file is not None)
        return None, f"cloud: {section('body', number, body)} comes from a file"
    needed = _needs_cloud(scene, by_pair)
    if needed is not None:
        if scene.particles.path == "lattice":
            raise scene.error("particles.path", f'"lattice" although {needed}', '"auto" or "cloud"')
        return None, f"cloud: {needed}"
    lattice, reason = find_common_lattice(lattices)
    if lattice is not None:
        return lattice, "lattice: " + ("the body is" if len(lattices) == 1 else "all bodies are") + " filled with one lattice"
    if scene.particles.path == "lattice":
        raise scene.error("particles.path", f'"lattice" although {reason}', '"auto" or "cloud", or bodies that lie whole spacings apart')
    return None, f"cloud: {reason}"


def _needs_cloud(scene, by_pair):
    """Return why a scene's bonds are stored as lists, which hold what a stencil does not; None when they need not be."""
    if scene.particles.surface_correction != "none":
        return "each bond has its own surface correction"
    if by_pair:
        return _why_by_pair(scene)
    if scene.material[0].failure == "energy" and scene.material[0].model == "lps":
        return "bonds of lps break by their energy"
    return None


def _why_by_pair(scene):
    """Return why the family radii of a scene differ between pairs of bodies."""
    settings = [setting_of(scene, body) for body in scene.body]
    reasons = [f"{word} of bodies differ" for word, key in (("horizons", "horizon"), ("spacings", "spacing")) if len({getattr(each, key) for each in settings}) > 1]
    parted = [interface.bodies for interface in scene.interface if interface.bonds == "none"]
    if parted:
        reasons.append(f"the interface of '{parted[0][0]}' and '{parted[0][1]}' has no bonds")
    return " and ".join(reasons)


def make_shape(table):
    """Return the geometry of a shape table of the scene."""
    kind = table.shape
    if kind == "box":
        return shapes.Box(tuple(table.lower), tuple(table.upper))
    if kind == "cylinder":
        return shapes.Cylinder(tuple(table.start), tuple(table.end), table.radius, table.inner_radius or 0.0)
    if kind == "half_space":
        return shapes.HalfSpace(tuple(table.point), tuple(table.normal))
    if kind == "band":
        return shapes.Band(tuple(tuple(point) for point in table.points), table.radius)
    return (shapes.Disk if kind == "disk" else shapes.Sphere)(tuple(table.center), table.radius)


def path_of(scene):
    """Return the path that the particles of a scene take, "lattice" or "cloud", without reading files. Local."""
    return "cloud" if scene.brings_points else make_body(scene).path.split(":")[0]


def describe(scene, body, points, number, ids):
    """Return (volume, block) of points (n, dim) of the bodies `number` (n,), with their global ids (n,)."""
    kind = np.array([body.kinds.index(each) for each in kinds_by_body(scene)])[number]
    fixed = np.zeros(len(points), dtype=bool)
    for name in scene.damage.no_fail:
        fixed |= select(scene, body, name, points, number, ids)
    table = np.array([[body.blocks[(each, True)], body.blocks.get((each, False), 0)] for each in range(len(body.kinds))], dtype=np.uint8)
    volume = np.array(body.volumes)[number]
    for place, each in enumerate(body.lattices):
        if isinstance(each, PointBody):
            mine = number == place
            volume[mine] = each.volume[each.rows_of(ids[mine])]
    return volume, table[kind, fixed.astype(int)]


def select(scene, body, name, points, number, ids):
    """Return (n,) bool: which points (n, dim) of the bodies `number` (n,), with global ids (n,), lie in the region `name`. Local.

    body : Body, which holds the points of bodies from files that are asked for; those it does not hold are in no group.
    """
    if name == "all":
        return np.ones(len(points), dtype=bool)
    region = next(each for each in scene.region if each.name == name)
    if region.shape == "group":
        return _in_group(scene, body, region.group, number, ids)
    inside = make_shape(region).contains(points)
    if region.body is not None:
        inside &= number == [each.name for each in scene.body].index(region.body)
    return inside


def _in_group(scene, body, group, number, ids):
    """Return (n,) bool: which particles belong to a group of their body's file. Local."""
    inside = np.zeros(len(ids), bool)
    for place, each in enumerate(body.lattices):
        if isinstance(each, PointBody):
            mine = np.flatnonzero(number == place)
            row = each.rows_of(ids[mine])
            held = row >= 0
            inside[mine[held]] = (each.marks[row[held]] & bit_of(scene, scene.body[place], group)) != 0
    return inside
