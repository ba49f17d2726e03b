"""Scene -> loads, prescribed motions and initial states of particles."""
import numpy as np

from pdhpc.conditions import time_functions
from pdhpc.conditions.conditions import ParticleConditions
from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.kernels.bond_states import count_face
from pdhpc.scene.body import select
from pdhpc.scene.face_area import area_over_volume
from pdhpc.scene.sections import section

_PIECE = 1 << 18  # particles that a region is tested on at once: bounds the temporary memory


def select_particles(scene, body, parts, comm, name, key):
    """Return [(n_owned + n_ghost,) bool] of a region which must hold at least one particle; owned first, as in Particles.id. Collective."""
    selected = [_inside(scene, part.body, part.subdomain, name) for part in parts]
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
        ids = particles.id[piece]
        inside[piece] = select(scene, body, name, subdomain.places_at(slots[piece]), body.number_of(ids), ids)
    return inside


def make_conditions(scene, body, parts, comm):
    """Return [ParticleConditions] of this rank's parts; loads act on both copies of a shared particle alike. Collective."""
    loads, motions = [[] for _ in parts], [[] for _ in parts]
    held = [np.zeros((part.subdomain.particles.n_owned, scene.dim), dtype=bool) for part in parts]
    for number, load in enumerate(scene.load):
        key = f"{section('load', number, load)}: region"
        selected = select_particles(scene, body, parts, comm, load.region, key)
        members = [np.flatnonzero(inside[: part.subdomain.particles.n_owned]) for inside, part in zip(selected, parts)]
        slots = [part.subdomain.particles.slots[each] for part, each in zip(parts, members)]
        function = time_function(load.time)
        if load.type in ("displacement", "velocity"):
            components = [axis for axis, value in enumerate(load.value) if value != "free"]
            if comm.allreduce(sum(int(mask[np.ix_(each, components)].sum()) for mask, each in zip(held, members))):
                raise scene.error(key, f'"{load.region}", where another load prescribes the same component', "regions that do not overlap")
            for mask, each, own, chosen in zip(held, members, slots, motions):
                mask[np.ix_(each, components)] = True
                chosen.append(PrescribedMotion(own, components, [load.value[axis] for axis in components], function, load.type))
        else:
            densities = force_densities(scene, body, load, parts, selected, comm)
            for density, each, own, chosen in zip(densities, members, slots, loads):
                chosen.append(BodyForce(own, density[each], function))
    return [ParticleConditions(part.subdomain.particles, body.law.density, *each) for part, each in zip(parts, zip(loads, motions))]


def force_densities(scene, body, load, parts, selected, comm):
    """Return [(n_owned, dim) N/m^3] of a load at f = 1. Collective.

    Traction: total force = value times the area A of the region's face with outward normal `face`, spread evenly over its volume V: b = value A / V. Where all
    particles have one spacing, A counts those without a neighbour of the region in that direction; else see face_area.py.
    """
    value = np.asarray(load.value, dtype=float)
    if load.type == "gravity":
        return [body.law.density[part.subdomain.particles.owned(part.subdomain.particles.block)][:, None] * value for part in parts]
    if load.type == "traction" and (body.brings_points or len(set(body.volumes)) > 1):
        value = value * _area_over_volume(scene, load, parts, selected, comm)
    elif load.type == "traction":
        counts = comm.allreduce(sum(_count_face(load, part, inside, body.spacing) for part, inside in zip(parts, selected)))
        value = value * (counts[0] / (counts[1] * body.spacing))
    return [np.broadcast_to(value, (part.subdomain.particles.n_owned, scene.dim)) for part in parts]


def _area_over_volume(scene, load, parts, selected, comm):
    """Return A/V, 1/m, of the region of a traction whose particles differ in size. Collective."""
    points, volumes = [], []
    for part, inside in zip(parts, selected):
        particles = part.subdomain.particles
        members = np.flatnonzero(part.counted() & inside[: particles.n_owned]) if particles.n_owned else np.empty(0, np.int64)
        points.append(part.subdomain.places(members))
        volumes.append(particles.owned(particles.volume)[members])
    thickness = scene.thickness if scene.dim == 2 else 1.0
    return area_over_volume(comm, np.concatenate(points), np.concatenate(volumes), thickness, "xyz".index(load.face[1]))


def _count_face(load, part, inside, spacing):
    """Return (particles on the face of the region, particles in it), those that this part counts; spacing : of all particles, m. Local."""
    subdomain, particles = part.subdomain, part.subdomain.particles
    axis, sign = "xyz".index(load.face[1]), 1.0 if load.face[0] == "+" else -1.0
    by_slot = np.zeros(len(particles.position), bool)
    by_slot[particles.slots], by_slot[particles.ghost_slots] = inside[: particles.n_owned], inside[particles.n_owned :]
    counted = part.counted() & inside[: particles.n_owned]
    arrays = subdomain.bonds.arrays, subdomain.points, particles.third
    on_face = count_face(*arrays, particles.slots[counted], by_slot, axis, sign * spacing)
    return np.array([on_face, int(counted.sum())])


def time_function(table):
    """Return the time function of a load's time table."""
    if table.function == "ramp":
        return time_functions.Ramp(table.start, table.end)
    if table.function == "sine":
        return time_functions.Sine(table.frequency, table.phase)
    if table.function == "table":
        return time_functions.Table(tuple(table.times), tuple(table.values))
    return time_functions.Constant()


def set_initial_state(scene, body, parts, comm):
    """Set initial displacements and velocities: u = u0 + G (x - origin), and what the velocity has about an axis. Collective."""
    for number, initial in enumerate(scene.initial):
        selected = select_particles(scene, body, parts, comm, initial.region, f"initial[{number}]: region")
        for part, inside in zip(parts, selected):
            _add_initial_state(initial, part.subdomain, np.flatnonzero(inside[: part.subdomain.particles.n_owned]))


def _add_initial_state(initial, subdomain, members):
    """Add an initial state to some owned particles. Local."""
    particles = subdomain.particles
    if len(members):
        slots = particles.slots[members]
        places, about_axis = subdomain.places(members), initial.about_axis(particles.dim)
        offset = places - np.asarray(initial.origin if initial.origin is not None else [0.0] * particles.dim)
        for target, constant, gradient in (
            (particles.displacement, initial.displacement, initial.displacement_gradient),
            (particles.velocity, initial.velocity, initial.velocity_gradient),
        ):
            if constant is not None:
                target[slots] += np.asarray(constant)
            if gradient is not None:
                target[slots] += offset @ np.asarray(gradient).T
        if about_axis is not None:
            particles.velocity[slots] += about_axis.velocity(places)
