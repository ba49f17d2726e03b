"""One part of a body on one rank: the whole body's share, or that of a region with a time step of its own."""
import numpy as np

from pdhpc.geometry.points import PointBody
from pdhpc.parallel.comm import agree_on_error, smallest
from pdhpc.parallel.ghosts import GhostExchange
from pdhpc.parallel.partition import bisect
from pdhpc.peridynamics.bonds import SamePlace
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.crowding import find_crowded
from pdhpc.peridynamics.lattice_subdomain import make_lattice_subdomain, sample_lattice
from pdhpc.peridynamics.subdomain import SAMPLE, make_subdomain, reach_of, sample_in, sample_with_weights, slab_of
from pdhpc.peridynamics.surface import correct_surfaces
from pdhpc.scene.body import describe, radius_of
from pdhpc.scene.point_bodies import spread

_WITHIN = 0.25  # of its size: how deep a particle from a file lies in a drawn body that counts as one that overlaps


class Part:
    """Particles, bonds, ghosts and conditions.

    Attributes
    ----------
    comm : the ranks that have a share. subdomain : Subdomain. body : Body, with the points of bodies from files that are in reach. exchange : GhostExchange.
    conditions : Conditions. critical_dt : s, on all ranks.
    """

    def __init__(self, comm, subdomain, body):
        particles, self.body = subdomain.particles, body
        self.comm, self.subdomain, self.conditions, self.critical_dt = comm, subdomain, None, np.inf
        owned_ids, ghost_ids = particles.id[: particles.n_owned], particles.id[particles.n_owned :]
        self.exchange = GhostExchange(comm, owned_ids, ghost_ids, subdomain.ghost_owner, particles.slots, particles.ghost_slots)

    def correct_surfaces(self, body, method):
        """Give bonds the factors of a surface correction, from the families before pre-cracks. Collective over the part's ranks."""
        correct_surfaces(self.subdomain, body.law, *body.calibration(), self.exchange.bind, method)

    def counted(self):
        """Return (n_owned,) bool: the particles that this part counts when each of the body is to be counted once. Local."""
        return np.ones(self.subdomain.particles.n_owned, bool)

    def settle_bonds(self, law):
        """Make what depends on the bonds that are intact at the start. Collective over the part's ranks."""
        self.subdomain.make_state(law)
        self.refresh_state()

    def refresh_state(self):
        """Refresh the ghosts' a_i of state-based laws. Collective over the part's ranks."""
        if self.subdomain.state is not None:
            self.exchange.bind(self.subdomain.state[:, 0:1]).refresh()

    def critical_dt_of(self, comm):
        """Return critical_dt on ranks without a share too. Collective over `comm`."""
        return smallest(comm, self.critical_dt)

    def find_critical_step(self, law):
        """Set critical_dt. Collective over the part's ranks."""
        self.critical_dt = smallest(self.comm, stable_step(self.subdomain, law))


def sample_of(scene, body, comm):
    """Return this rank's (points, weights) of a body, what partitions are computed from; weights add up to about its directed bonds. Collective."""
    radius, lattices = body.reach, body.lattices
    if body.brings_points:
        return _sample_of_points(body, comm, radius)
    with agree_on_error(comm):
        if body.lattice is not None:
            return sample_lattice(lattices, body.lattice, comm.rank, comm.size, radius)
        return sample_with_weights(lattices, _bounds_of_all(lattices), comm.rank, comm.size, radius)


def _sample_of_points(body, comm, radius):
    """Return sample_of a body with points from files: a first partition, by numbers of particles, brings together what has to be counted. Collective."""
    lower, upper = slab_of(_bounds_of_all(body.lattices), comm.rank, comm.size)
    everywhere = np.full(len(lower), np.inf)
    points, weights = [], []
    for each in body.lattices:
        box = (-everywhere, everywhere) if isinstance(each, PointBody) else (lower, upper)
        ids, places = each.points_in(*box)
        share = max(1, len(ids) // SAMPLE)
        chosen = (ids * 2654435761 >> 12) % share == 0
        points.append(places[chosen])
        weights.append(np.full(len(points[-1]), share))
    first = bisect(comm, np.concatenate(points), np.concatenate(weights))
    held = place_points(body, comm, first, radius)
    with agree_on_error(comm):
        return sample_in(held.lattices, *first.box(comm.rank, len(lower)), radius)


def place_points(body, comm, partition, radius, first=0):
    """Return a Body with the points of its files on the ranks in reach of them, the k-th box of the partition being that of rank first + k. Collective."""
    if not body.brings_points:
        return body
    reach = reach_of(radius) * (1 + 1e-9)
    return body._replace(lattices=[spread(comm, each, partition, reach, first) if isinstance(each, PointBody) else each for each in body.lattices])


def _bounds_of_all(lattices):
    """Return (lower, upper), m, of some bodies in their windows."""
    bounds = np.array([_bounds(each) for each in lattices])
    return bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)


def _bounds(lattice):
    """Return (lower, upper), m, of the part of a body in its window."""
    lower, upper = lattice.bounds()
    if lattice.window is None:
        return lower, upper
    inner, outer = lattice.window.bounds()
    lower = np.minimum(np.maximum(lower, inner), upper)
    return lower, np.maximum(np.minimum(upper, outer), lower)


def partition_of(scene, body, comm, sample=None, shares=None):
    """Return the Partition of a body over the ranks (or over as many as `shares` names), by numbers of bonds; on a lattice it cuts between layers. Collective."""
    sample = sample_of(scene, body, comm) if sample is None else sample
    return bisect(comm, *sample, None if body.lattice is None else body.lattice.between, shares)


def make_part(scene, body, comm, partition):
    """Return this rank's Part of the whole body. Collective. Raises as make_subdomain_of."""
    held = place_points(body, comm, partition, radius_of(scene))
    return Part(comm, make_subdomain_of(scene, held, partition, comm, comm.rank), held)


def make_subdomain_of(scene, body, partition, comm, leaf):
    """Return this rank's Subdomain of a body, the leaf-th box of the partition. Collective over `comm`.

    Raises
    ------
    SceneError, on every rank of `comm`: bodies whose particles coincide, or lie too close where some come from files.
    """
    radius, linear = body.reach, scene.particles.kinematics == "linear"

    def describe_points(points, number, ids):
        return describe(scene, body, points, number, ids)

    with agree_on_error(comm):
        try:
            if body.lattice is not None:
                made = make_lattice_subdomain(body.lattices, body.lattice, partition, leaf, radius, describe_points, body.law, linear)
            else:
                made = make_subdomain(body.lattices, partition, leaf, radius, describe_points, linear)
            if body.brings_points:
                _check_apart(scene, body, made, radius)
        except SamePlace as error:
            found = f"{' and '.join(_called(scene, body, each) for each in error.ids)} at the same place" if body.brings_points else str(error)
            raise scene.error("body", found, "bodies that do not overlap") from error
        except ValueError as error:
            raise scene.error("body", str(error), "bodies that do not overlap") from error
    if body.brings_points:
        with agree_on_error(comm):  # once no rank has found any too close, so that all say the same on any number of ranks
            _check_outside_drawn(scene, body, made)
    return made


def _sizes_of(scene, particles):
    """Return (n_owned + n_ghost,) m, sides of squares or cubes of the particles' volumes. Local."""
    return (particles.volume / (scene.thickness if scene.dim == 2 else 1.0)) ** (1 / scene.dim)


def _check_apart(scene, body, subdomain, radius):
    """Raise a ValueError where bodies, some of them from files, overlap: see crowding.py. Local."""
    particles, thickness, size = subdomain.particles, scene.thickness if scene.dim == 2 else 1.0, _sizes_of(scene, subdomain.particles)
    radius = np.broadcast_to(radius, (len(body.lattices),) * 2)
    ball = np.pi * radius**2 * thickness if scene.dim == 2 else 4 / 3 * np.pi * radius**3
    found = find_crowded(subdomain, size, body.number_of(particles.id), ball)
    if found is not None:
        i, j, fullness = found
        both = f"{_called(scene, body, particles.id[i])} and {_called(scene, body, particles.id[j])}"
        if fullness:
            raise ValueError(f"{both} in a family of {fullness:.2f} times the volume of its ball")
        apart = float(np.linalg.norm(particles.reference[i] - particles.reference[j]))
        raise ValueError(f"{both} only {apart:.6g} m apart, {2 * apart / (size[i] + size[j]):.2g} of their mean size")


def _check_outside_drawn(scene, body, subdomain):
    """Raise a SceneError where a particle from a file lies within a drawn shape. Local."""
    particles = subdomain.particles
    row, drawn = _within_drawn(body, particles.reference, _sizes_of(scene, particles), body.number_of(particles.id))
    if row is not None:
        found = f"{_called(scene, body, particles.id[row])} within body '{scene.body[drawn].name}'"
        raise scene.error("body", found, "bodies that do not overlap")


def _within_drawn(body, points, size, number):
    """Return (row, number of the drawn body) of a particle from a file that lies within a drawn body, by a quarter of its size at least; (None, None) without."""
    from_files = np.array([isinstance(each, PointBody) for each in body.lattices])
    steps = np.concatenate([np.zeros((1, points.shape[1])), np.eye(points.shape[1]), -np.eye(points.shape[1])])
    for drawn in np.flatnonzero(~from_files):
        rows = np.flatnonzero(from_files[number])
        for step in steps:
            rows = rows[body.lattices[drawn].contains(points[rows] + _WITHIN * size[rows, None] * step)]
        if len(rows):
            return rows[0], drawn
    return None, None


def _called(scene, body, id):
    """Return how a particle is called: by the row of its file, or by its place among the cells of its body."""
    number = int(body.number_of(np.array([id]))[0])
    table, row = scene.body[number], int(id) - body.lattices[number].first_id + 1
    return f"{'row' if table.shape == 'table' else 'cell'} {row} of body '{table.name}'"
