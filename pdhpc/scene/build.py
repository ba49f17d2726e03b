"""Scene -> objects: the rank's particles in one or two regions, conditions, time step, stepper and gauges."""
import math
from dataclasses import dataclass
from typing import Callable, List, Optional

import numpy as np

from pdhpc.conditions import time_functions
from pdhpc.conditions.conditions import Conditions
from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.geometry import cracks
from pdhpc.kernels.bond_states import count_face
from pdhpc.observers.crack_tip import CrackTip
from pdhpc.observers.energies import Energies
from pdhpc.observers.probes import Probe, nearest_particle
from pdhpc.peridynamics.bonds import cut_by_cracks
from pdhpc.peridynamics.velocity_verlet import VelocityVerlet
from pdhpc.scene.body import Body, make_body, select
from pdhpc.scene.parts import Part, make_part, partition_of
from pdhpc.scene.regions import Regions, make_regions
from pdhpc.scene.sections import section

_PIECE = 1 << 18  # particles that a region is tested on at once: bounds the temporary memory


@dataclass
class Problem:
    """Everything one rank needs to run a scene.

    parts : the body, or its coarse and its fine region. dt : s, of the body, or of the coarse region: the macro step. critical_dt : s, of the body, or the
    smaller one of the regions'. make_stepper : function dt -> what advances. regions : with a fine region. m : steps of the fine region in one of these; 1 without one.
    """

    scene: object
    body: Body
    parts: List[Part]
    critical_dt: float
    dt: float
    m: int
    n_steps: int
    warnings: List[str]
    make_stepper: Callable
    regions: Optional[Regions] = None

    @property
    def subdomain(self):
        """Subdomain of the first part."""
        return self.parts[0].subdomain

    @property
    def exchange(self):
        """GhostExchange of the first part."""
        return self.parts[0].exchange

    @property
    def conditions(self):
        """Conditions of the first part."""
        return self.parts[0].conditions

    def stepper(self):
        """Return what advances this problem from t = 0: a VelocityVerlet or a stepper of mts/. Collective."""
        return self.make_stepper(self.dt)


def build(scene, comm):
    """Return the Problem of `scene` on this rank; every rank makes its own share in place. Collective.

    Raises
    ------
    SceneError, on every rank: a region, load, crack or probe that selects nothing, a step above the critical one, bodies that overlap.
    """
    body = make_body(scene)
    if scene.method != "single":
        return _build_regions(scene, body, comm)
    part = make_part(scene, body, comm, partition_of(scene, body, comm))
    _furnish(scene, body, [part], comm)
    dt, n_steps, warnings = choose_step(scene, part.critical_dt)
    if scene.fine is not None:
        warnings.append('[fine] is not used: time.method = "single" takes one step for the whole body')

    def make_stepper(dt):
        return VelocityVerlet(part.subdomain, body.law, part.conditions, part.exchange.bind, dt)

    return Problem(scene, body, [part], part.critical_dt, dt, 1, n_steps, warnings, make_stepper)


def _build_regions(scene, body, comm):
    """Return the Problem of a scene with a fine region. Collective."""
    m = 1 if scene.fine.step_ratio == "auto" else scene.fine.step_ratio
    while True:
        regions = make_regions(scene, body, comm, m)
        regions.check_shape()
        _furnish(scene, body, regions.parts, comm)
        dt, n_steps, warnings = choose_step(scene, regions.critical_macro_dt())
        chosen = regions.choose_ratio(dt)
        if chosen <= m or scene.fine.step_ratio != "auto":
            break
        m = chosen  # the shares of the ranks depend on it
    if "error" in scene.time.model_fields_set and scene.fine.step_ratio != "auto":
        warnings.append('time.error is not used: fine.step_ratio is given, not "auto"')
    warnings += regions.check(dt)
    critical = min(part.critical_dt_of(comm) for part in regions.parts)
    return Problem(scene, body, regions.parts, critical, dt, m, n_steps, warnings, regions.stepper, regions)


def _furnish(scene, body, parts, comm):
    """Cut pre-cracks, and give the parts their conditions, initial state and critical step. Collective."""
    if comm.allreduce(sum(part.subdomain.particles.n_owned for part in parts)) == 0:
        raise scene.error("body", "no particle", "a body that is not wholly a hole")
    for name in scene.damage.no_fail:
        _selected(scene, body, parts, comm, name, "damage.no_fail")
    _cut_cracks(scene, parts, comm)
    for part in parts:
        part.settle_bonds(body.law)
    for part, conditions in zip(parts, _make_conditions(scene, body, parts, comm)):
        part.conditions = conditions
    _set_initial_state(scene, body, parts, comm)
    for part in parts:
        part.find_critical_step(body.law)


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


def _selected(scene, body, parts, comm, name, key):
    """Return [(n_owned + n_ghost,) bool] of a region which must hold at least one particle; owned first, as in Particles.id. Collective."""
    selected = [_inside(scene, body, part.subdomain, name) for part in parts]
    if comm.allreduce(sum(int(inside[: part.subdomain.particles.n_owned].sum()) for inside, part in zip(selected, parts))) == 0:
        raise scene.error(key, f'"{name}", which selects no particle', "a region that holds at least one")
    return selected


def _inside(scene, body, subdomain, name):
    """Return (n_owned + n_ghost,) bool, which particles of a subdomain lie in a region. Local."""
    particles = subdomain.particles
    slots = np.concatenate([particles.slots, particles.ghost_slots])
    inside = np.empty(len(slots), bool)
    for first in range(0, len(slots), _PIECE):
        piece = slice(first, first + _PIECE)
        inside[piece] = select(scene, name, subdomain.places_at(slots[piece]), body.number_of(particles.id[piece]))
    return inside


def _members(scene, body, view, comm, name, key):
    """Return the particles of a view in a region as indices. Collective."""
    members = np.flatnonzero(select(scene, name, view.places(), body.number_of(view.ids)))
    if comm.allreduce(len(members)) == 0:
        raise scene.error(key, f'"{name}", which selects no particle', "a region that holds at least one")
    return members


def _cut_cracks(scene, parts, comm):
    """Cut the bonds that cross the pre-cracks. Collective."""
    for number, crack in enumerate(scene.crack):
        if crack.type == "polyline":
            facets = cracks.polyline(crack.points)
        elif crack.type == "rectangle":
            facets = cracks.rectangle(crack.corner, crack.edge1, crack.edge2)
        else:
            facets = cracks.disk(crack.center, crack.normal, crack.radius)
        if comm.allreduce(sum(cut_by_cracks(part.subdomain.bonds, part.subdomain.points, facets) for part in parts)) == 0:
            raise scene.error(section("crack", number, crack), "a crack that cuts no bond", "a crack that crosses a body")


def _make_conditions(scene, body, parts, comm):
    """Return [Conditions] of this rank's parts; loads act on both copies of a shared particle alike. Collective."""
    loads, motions = [[] for _ in parts], [[] for _ in parts]
    held = [np.zeros((part.subdomain.particles.n_owned, scene.dim), dtype=bool) for part in parts]
    for number, load in enumerate(scene.load):
        key = f"{section('load', number, load)}: region"
        selected = _selected(scene, body, parts, comm, load.region, key)
        members = [np.flatnonzero(inside[: part.subdomain.particles.n_owned]) for inside, part in zip(selected, parts)]
        slots = [part.subdomain.particles.slots[each] for part, each in zip(parts, members)]
        time_function = _time_function(load.time)
        if load.type in ("displacement", "velocity"):
            components = [axis for axis, value in enumerate(load.value) if value != "free"]
            if comm.allreduce(sum(int(mask[np.ix_(each, components)].sum()) for mask, each in zip(held, members))):
                raise scene.error(key, f'"{load.region}", where another load prescribes the same component', "regions that do not overlap")
            for mask, each, own, chosen in zip(held, members, slots, motions):
                mask[np.ix_(each, components)] = True
                chosen.append(PrescribedMotion(own, components, [load.value[axis] for axis in components], time_function, load.type))
        else:
            densities = _force_densities(scene, body, load, parts, selected, comm)
            for density, each, own, chosen in zip(densities, members, slots, loads):
                chosen.append(BodyForce(own, density[each], time_function))
    return [Conditions(part.subdomain.particles, body.law.density, *each) for part, each in zip(parts, zip(loads, motions))]


def _force_densities(scene, body, load, parts, selected, comm):
    """Return [(n_owned, dim) N/m^3] of a load at f = 1. Collective.

    Traction: total force = value times the area A of the region's face with outward normal `face`, spread evenly over its volume V: b = value A / V.
    """
    value = np.asarray(load.value, dtype=float)
    if load.type == "gravity":
        return [body.law.density[part.subdomain.particles.owned(part.subdomain.particles.block)][:, None] * value for part in parts]
    if load.type == "traction":
        counts = comm.allreduce(sum(_count_face(scene, load, part, inside) for part, inside in zip(parts, selected)))
        value = value * (counts[0] / (counts[1] * scene.particles.spacing))
    return [np.broadcast_to(value, (part.subdomain.particles.n_owned, scene.dim)) for part in parts]


def _count_face(scene, load, part, inside):
    """Return (particles on the face of the region, particles in it), those that this part counts. Local."""
    subdomain, particles = part.subdomain, part.subdomain.particles
    axis, sign = "xyz".index(load.face[1]), 1.0 if load.face[0] == "+" else -1.0
    by_slot = np.zeros(len(particles.position), bool)
    by_slot[particles.slots], by_slot[particles.ghost_slots] = inside[: particles.n_owned], inside[particles.n_owned :]
    counted = part.counted() & inside[: particles.n_owned]
    arrays = subdomain.bonds.arrays, subdomain.points, particles.third
    on_face = count_face(*arrays, particles.slots[counted], by_slot, axis, sign * scene.particles.spacing)
    return np.array([on_face, int(counted.sum())])


def _time_function(table):
    """Return the time function of a load's time table."""
    if table.function == "ramp":
        return time_functions.Ramp(table.start, table.end)
    if table.function == "sine":
        return time_functions.Sine(table.frequency, table.phase)
    if table.function == "table":
        return time_functions.Table(tuple(table.times), tuple(table.values))
    return time_functions.Constant()


def _set_initial_state(scene, body, parts, comm):
    """Set initial displacements and velocities: u = u0 + G (x - origin). Collective."""
    for number, initial in enumerate(scene.initial):
        selected = _selected(scene, body, parts, comm, initial.region, f"initial[{number}]: region")
        for part, inside in zip(parts, selected):
            _add_initial_state(initial, part.subdomain, np.flatnonzero(inside[: part.subdomain.particles.n_owned]))


def _add_initial_state(initial, subdomain, members):
    """Add an initial state to some owned particles. Local."""
    particles = subdomain.particles
    if len(members):
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


def make_gauges(problem, view, comm):
    """Return (energies, probes, tips) of a problem, seen as the stepper's `view`: what history.csv records. Collective."""
    scene, body = problem.scene, problem.body
    probes = []
    for probe in scene.probe:
        if probe.point is not None:
            members = nearest_particle(comm, view, probe.point)
        else:
            members = _members(scene, body, view, comm, probe.region, f"probe '{probe.name}': region")
        probes.append(Probe(comm, probe.name, probe.quantity, members, scene.dim))
    tips = []
    for tip in scene.tip:
        members = _members(scene, body, view, comm, tip.region, f"tip '{tip.name}': region")
        tips.append(CrackTip(comm, tip, members, view, problem.dt))
    return Energies(comm), probes, tips
