"""Scene -> objects: bodies, the rank's subdomain, conditions, time step, stepper and gauges."""
import math
from dataclasses import dataclass
from typing import List, NamedTuple, Optional

import numpy as np

from pdhpc.conditions import time_functions
from pdhpc.conditions.conditions import Conditions
from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.geometry import cracks, shapes
from pdhpc.geometry.lattice import CommonLattice, LatticeBody, find_common_lattice
from pdhpc.kernels.bond_states import count_face
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting, family_radius
from pdhpc.materials.state_based import LinearSolid
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.observers.crack_tip import CrackTip
from pdhpc.observers.energies import Energies
from pdhpc.observers.probes import Probe, nearest_particle
from pdhpc.parallel.comm import agree_on_error
from pdhpc.parallel.ghosts import GhostExchange
from pdhpc.parallel.partition import bisect
from pdhpc.peridynamics.bonds import cut_by_cracks
from pdhpc.peridynamics.lattice_subdomain import make_lattice_subdomain, sample_lattice
from pdhpc.peridynamics.subdomain import Subdomain, make_subdomain, sample_with_weights
from pdhpc.peridynamics.velocity_verlet import VelocityVerlet
from pdhpc.scene.rules import section


_PIECE = 1 << 18  # particles that a region is tested on at once: bounds the temporary memory


class Body(NamedTuple):
    """The bodies of a scene as geometry, with what tells their particles apart."""

    lattices: List[LatticeBody]
    materials: List[object]  # BondBased or LinearSolid
    law: object  # of these materials, see materials/law.py
    blocks: dict  # (material number, may fail) -> block
    cell_volume: float  # m^3
    lattice: Optional[CommonLattice]  # that all bodies lie on: then the lattice path is taken
    path: str  # "lattice" or "cloud", and why


@dataclass
class Problem:
    """Everything one rank needs to run a scene."""

    scene: object
    body: Body
    subdomain: Subdomain
    exchange: GhostExchange
    conditions: Conditions
    critical_dt: float
    dt: float
    n_steps: int
    warnings: List[str]

    def stepper(self):
        """Return the VelocityVerlet of this problem, at t = 0. Collective."""
        return VelocityVerlet(self.subdomain, self.body.law, self.conditions, self.exchange.bind, self.dt)


def build(scene, comm):
    """Return the Problem of `scene` on this rank; every rank makes its own share in place. Collective.

    Raises
    ------
    SceneError, on every rank: a region, load, crack or probe that selects nothing, a step above the critical one, bodies that overlap.
    """
    body = make_body(scene)
    partition = _make_partition(scene, body, comm)
    with agree_on_error(comm):
        subdomain = _make_share(scene, body, partition, comm.rank)
    particles = subdomain.particles
    owned_ids, ghost_ids = particles.id[: particles.n_owned], particles.id[particles.n_owned :]
    exchange = GhostExchange(comm, owned_ids, ghost_ids, subdomain.ghost_owner, particles.slots, particles.ghost_slots)
    if comm.allreduce(particles.n_owned) == 0:
        raise scene.error("body", "no particle", "a body that is not wholly a hole")
    for name in scene.damage.no_fail:
        _selected(scene, body, subdomain, comm, name, "damage.no_fail")
    _cut_cracks(scene, subdomain, comm)
    subdomain.make_state(body.law)
    if subdomain.state is not None:
        exchange.bind(subdomain.state[:, 0:1]).refresh()
    conditions = _make_conditions(scene, body, subdomain, comm)
    _set_initial_state(scene, body, subdomain, comm)
    critical = min(comm.allgather(stable_step(subdomain, body.law)))
    dt, n_steps, warnings = choose_step(scene, critical)
    return Problem(scene, body, subdomain, exchange, conditions, critical, dt, n_steps, warnings)


def _make_partition(scene, body, comm):
    """Return the Partition of the bodies over the ranks, by numbers of bonds; on a lattice it cuts between layers of cells. Collective."""
    radius, lattices = radius_of(scene), body.lattices
    if body.lattice is not None:
        with agree_on_error(comm):
            sample = sample_lattice(lattices, body.lattice, comm.rank, comm.size, radius)
        return bisect(comm, *sample, body.lattice.between)
    bounds = np.min([b.bounds()[0] for b in lattices], axis=0), np.max([b.bounds()[1] for b in lattices], axis=0)
    with agree_on_error(comm):
        sample = sample_with_weights(lattices, bounds, comm.rank, comm.size, radius)
    return bisect(comm, *sample)


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
    failing = (True, False) if scene.damage.no_fail else (True,)
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
    return (shapes.Disk if kind == "disk" else shapes.Sphere)(tuple(table.center), table.radius)


def choose_step(scene, critical):
    """Return (dt, number of steps, warnings): the scene's step, or safety times the critical one so that whole steps reach the end.

    Raises
    ------
    SceneError: a given step above the critical one without allow_unstable.
    """
    setting = scene.time
    if setting.dt == "auto":
        if not math.isfinite(critical):
            raise scene.error("time.dt", '"auto" although no particle has a bond', "a number of seconds")
        n_steps = max(1, math.ceil(setting.end / (setting.safety * critical)))
        return setting.end / n_steps, n_steps, []
    n_steps = max(1, math.ceil(setting.end / setting.dt * (1 - 1e-12)))
    if setting.dt <= critical:
        return setting.dt, n_steps, []
    if not setting.allow_unstable:
        raise scene.error("time.dt", f"{setting.dt:g} s", f'"auto" or a step up to the critical {critical:.6g} s, unless time.allow_unstable = true')
    return setting.dt, n_steps, [f"time.dt = {setting.dt:g} s is above the critical step {critical:.6g} s (allow_unstable is set)"]


def _make_share(scene, body, partition, rank):
    """Return this rank's Subdomain; bodies whose particles coincide become a SceneError. Local."""
    radius, linear = radius_of(scene), scene.particles.kinematics == "linear"

    def describe(points, number):
        return _describe(scene, body, points, number)

    try:
        if body.lattice is not None:
            return make_lattice_subdomain(body.lattices, body.lattice, partition, rank, radius, describe, body.law, linear)
        return make_subdomain(body.lattices, partition, rank, radius, describe, linear)
    except ValueError as error:
        raise scene.error("body", str(error), "bodies that do not overlap") from error


def _describe(scene, body, points, number):
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


def _selected(scene, body, subdomain, comm, name, key):
    """Return (n_owned + n_ghost,) bool of a region which must hold at least one particle; owned first, as in Particles.id. Collective."""
    particles = subdomain.particles
    slots = np.concatenate([particles.slots, particles.ghost_slots])
    inside = np.empty(len(slots), bool)
    firsts = np.array([lattice.first_id for lattice in body.lattices])
    for first in range(0, len(slots), _PIECE):
        piece = slice(first, first + _PIECE)
        number = np.searchsorted(firsts, particles.id[piece], side="right") - 1
        inside[piece] = select(scene, name, subdomain.places_at(slots[piece]), number)
    if comm.allreduce(int(inside[: particles.n_owned].sum())) == 0:
        raise scene.error(key, f'"{name}", which selects no particle', "a region that holds at least one")
    return inside


def _members(scene, body, subdomain, comm, name, key):
    """Return the owned particles of a region as indices. Collective."""
    return np.flatnonzero(_selected(scene, body, subdomain, comm, name, key)[: subdomain.particles.n_owned])


def _cut_cracks(scene, subdomain, comm):
    """Cut the bonds that cross the pre-cracks. Collective."""
    for number, crack in enumerate(scene.crack):
        if crack.type == "polyline":
            facets = cracks.polyline(crack.points)
        elif crack.type == "rectangle":
            facets = cracks.rectangle(crack.corner, crack.edge1, crack.edge2)
        else:
            facets = cracks.disk(crack.center, crack.normal, crack.radius)
        if comm.allreduce(cut_by_cracks(subdomain.bonds, subdomain.points, facets)) == 0:
            raise scene.error(section("crack", number, crack), "a crack that cuts no bond", "a crack that crosses a body")


def _make_conditions(scene, body, subdomain, comm):
    """Return the Conditions of this rank. Collective."""
    particles = subdomain.particles
    loads, motions = [], []
    held = np.zeros((particles.n_owned, particles.dim), dtype=bool)
    for number, load in enumerate(scene.load):
        key = f"{section('load', number, load)}: region"
        selected = _selected(scene, body, subdomain, comm, load.region, key)
        members = np.flatnonzero(selected[: particles.n_owned])
        slots = particles.slots[members]
        time_function = _time_function(load.time)
        if load.type in ("displacement", "velocity"):
            components = [axis for axis, value in enumerate(load.value) if value != "free"]
            twice = int(held[np.ix_(members, components)].sum())
            if comm.allreduce(twice):
                raise scene.error(key, f'"{load.region}", where another load prescribes the same component', "regions that do not overlap")
            held[np.ix_(members, components)] = True
            motions.append(PrescribedMotion(slots, components, [load.value[axis] for axis in components], time_function, load.type))
        else:
            loads.append(BodyForce(slots, _force_density(scene, body, load, subdomain, selected, comm)[members], time_function))
    return Conditions(particles, body.law.density, loads, motions)


def _force_density(scene, body, load, subdomain, selected, comm):
    """Return (n_owned, dim) N/m^3 of a load at f = 1. Collective.

    Traction: total force = value times the area A of the region's face with outward normal `face`, spread evenly over its volume V: b = value A / V.
    """
    particles = subdomain.particles
    value = np.asarray(load.value, dtype=float)
    if load.type == "gravity":
        return body.law.density[particles.owned(particles.block)][:, None] * value
    if load.type == "traction":
        axis, sign = "xyz".index(load.face[1]), 1.0 if load.face[0] == "+" else -1.0
        spacing = scene.particles.spacing
        by_slot = np.zeros(len(particles.position), bool)
        by_slot[particles.slots], by_slot[particles.ghost_slots] = selected[: particles.n_owned], selected[particles.n_owned :]
        on_face = count_face(subdomain.bonds.arrays, subdomain.points, particles.third, particles.slots, by_slot, axis, sign * spacing)
        on_face, inside = comm.allreduce(np.array([on_face, int(selected[: particles.n_owned].sum())]))
        value = value * (on_face / (inside * spacing))
    return np.broadcast_to(value, (particles.n_owned, particles.dim))


def _time_function(table):
    """Return the time function of a load's time table."""
    if table.function == "ramp":
        return time_functions.Ramp(table.start, table.end)
    if table.function == "sine":
        return time_functions.Sine(table.frequency, table.phase)
    if table.function == "table":
        return time_functions.Table(tuple(table.times), tuple(table.values))
    return time_functions.Constant()


def _set_initial_state(scene, body, subdomain, comm):
    """Set initial displacements and velocities: u = u0 + G (x - origin). Collective."""
    particles = subdomain.particles
    for number, initial in enumerate(scene.initial):
        members = _members(scene, body, subdomain, comm, initial.region, f"initial[{number}]: region")
        slots = particles.slots[members]
        offset = subdomain.places(members) - np.asarray(initial.origin if initial.origin is not None else [0.0] * particles.dim)
        for target, constant, gradient in (
            (particles.displacement, initial.displacement, initial.displacement_gradient),
            (particles.velocity, initial.velocity, initial.velocity_gradient),
        ):
            if constant is not None:
                target[slots] += np.asarray(constant)
            if gradient is not None:
                target[slots] += offset @ np.asarray(gradient).T


def make_gauges(problem, comm):
    """Return (energies, probes, tips) of a problem: what history.csv records. Collective."""
    scene, body, subdomain = problem.scene, problem.body, problem.subdomain
    probes = []
    for probe in scene.probe:
        if probe.point is not None:
            members = nearest_particle(comm, subdomain, probe.point)
        else:
            members = _members(scene, body, subdomain, comm, probe.region, f"probe '{probe.name}': region")
        probes.append(Probe(comm, probe.name, probe.quantity, members, scene.dim))
    tips = []
    for tip in scene.tip:
        members = _members(scene, body, subdomain, comm, tip.region, f"tip '{tip.name}': region")
        tips.append(CrackTip(comm, tip, members, subdomain, problem.dt))
    return Energies(comm), probes, tips
