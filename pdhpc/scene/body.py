"""Scene -> bodies: geometry, materials and what tells the particles of a scene apart; nothing that grows with their number."""
from dataclasses import replace
from typing import List, NamedTuple, Optional

import numpy as np

from pdhpc.geometry import shapes
from pdhpc.geometry.lattice import CommonLattice, LatticeBody, find_common_lattice
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting, family_radius
from pdhpc.materials.state_based import LinearSolid


class Body(NamedTuple):
    """The bodies of a scene as geometry, with what tells their particles apart."""

    lattices: List[LatticeBody]
    materials: List[object]  # BondBased or LinearSolid
    law: object  # of these materials, see materials/law.py
    blocks: dict  # (material number, may fail) -> block
    cell_volume: float  # m^3
    lattice: Optional[CommonLattice]  # that all bodies lie on: then the lattice path is taken
    path: str  # "lattice" or "cloud", and why

    def number_of(self, ids):
        """Return (n,) the body of each particle, by global id."""
        return np.searchsorted(np.array([lattice.first_id for lattice in self.lattices]), ids, side="right") - 1

    def seen_through(self, window):
        """Return the Body of the particles in a window, a shape."""
        return self._replace(lattices=[replace(lattice, window=window) for lattice in self.lattices])


def radius_of(scene):
    """Return the radius of the families of a scene, m."""
    return family_radius(scene.particles.horizon, scene.particles.spacing, scene.particles.volume_correction)


def make_body(scene):
    """Return the Body of a scene. Local; allocates nothing that grows with the number of particles."""
    setting = scene.particles
    lattices, first_id = [], 0
    for body in scene.body:
        holes = tuple(make_shape(hole) for hole in body.hole)
        lattices.append(LatticeBody(make_shape(body), setting.spacing, first_id, holes))
        first_id = lattices[-1].last_id
    materials = [_make_material(table) for table in scene.material]
    failing = (True, False) if scene.damage.no_fail or scene.model == "gfem" else (True,)
    blocks = {(number, may_fail): None for number in range(len(materials)) for may_fail in failing}
    blocks = {key: block for block, key in enumerate(blocks)}
    thickness = scene.thickness
    law = type(materials[0]).law([(materials[number], may_fail) for number, may_fail in blocks], calibration_of(scene))
    lattice, path = _choose_path(scene, lattices)
    return Body(lattices, materials, law, blocks, setting.spacing**scene.dim * thickness, lattice, path)


def calibration_of(scene):
    """Return the Setting that calibrates the materials of a scene."""
    setting = scene.particles
    linear = setting.kinematics == "linear"
    return Setting(scene.dimension, setting.horizon, scene.thickness, setting.influence, setting.spacing, setting.volume_correction, linear)


def _make_material(table):
    """Return the material of a material table."""
    strength = table.energy_release_rate, table.critical_stretch
    if table.model == "pmb":
        return BondBased(table.name, table.density, table.youngs_modulus, *strength)
    moduli = table.bulk_modulus, table.shear_modulus
    if table.youngs_modulus is not None:
        moduli = LinearSolid.moduli(table.youngs_modulus, table.poissons_ratio)
    return LinearSolid(table.name, table.density, *moduli, *strength)


def _choose_path(scene, lattices):
    """Return (CommonLattice or None, "lattice: why" or "cloud: why")."""
    if scene.particles.path == "cloud":
        return None, 'cloud: asked for by particles.path = "cloud"'
    lattice, reason = find_common_lattice(lattices)
    if lattice is not None:
        return lattice, "lattice: " + ("the body is" if len(lattices) == 1 else "all bodies are") + " filled with one lattice"
    if scene.particles.path == "lattice":
        raise scene.error("particles.path", f'"lattice" although {reason}', '"auto" or "cloud", or bodies that lie whole spacings apart')
    return None, f"cloud: {reason}"


def make_shape(table):
    """Return the geometry of a shape table of the scene."""
    kind = table.shape
    if kind == "box":
        return shapes.Box(tuple(table.lower), tuple(table.upper))
    if kind == "cylinder":
        return shapes.Cylinder(tuple(table.start), tuple(table.end), table.radius)
    if kind == "half_space":
        return shapes.HalfSpace(tuple(table.point), tuple(table.normal))
    if kind == "band":
        return shapes.Band(tuple(tuple(point) for point in table.points), table.radius)
    return (shapes.Disk if kind == "disk" else shapes.Sphere)(tuple(table.center), table.radius)


def describe(scene, body, points, number):
    """Return (volume, block) of points (n, dim) of the bodies `number` (n,)."""
    names = [material.name for material in scene.material]
    material = np.array([names.index(each.material) for each in scene.body])[number]
    fixed = np.zeros(len(points), dtype=bool)
    for name in scene.damage.no_fail:
        fixed |= select(scene, name, points, number)
    table = np.array([[body.blocks[(m, True)], body.blocks.get((m, False), 0)] for m in range(len(names))], dtype=np.uint8)
    return np.full(len(points), body.cell_volume), table[material, fixed.astype(int)]


def select(scene, name, points, number):
    """Return (n,) bool: which points (n, dim) of the bodies `number` (n,) lie in the region `name`. Local."""
    if name == "all":
        return np.ones(len(points), dtype=bool)
    region = next(each for each in scene.region if each.name == name)
    inside = make_shape(region).contains(points)
    if region.body is not None:
        inside &= number == [each.name for each in scene.body].index(region.body)
    return inside
