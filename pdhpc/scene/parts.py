"""One part of a body on one rank: the whole body's share, or that of a region with a time step of its own."""
import numpy as np

from pdhpc.parallel.comm import agree_on_error, smallest
from pdhpc.parallel.ghosts import GhostExchange
from pdhpc.parallel.partition import bisect
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.lattice_subdomain import make_lattice_subdomain, sample_lattice
from pdhpc.peridynamics.subdomain import make_subdomain, sample_with_weights
from pdhpc.peridynamics.surface import correct_surfaces
from pdhpc.scene.body import describe


class Part:
    """Particles, bonds, ghosts and conditions.

    Attributes
    ----------
    comm : the ranks that have a share. subdomain : Subdomain. exchange : GhostExchange. conditions : Conditions. critical_dt : s, on all ranks.
    """

    def __init__(self, comm, subdomain):
        particles = subdomain.particles
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
    with agree_on_error(comm):
        if body.lattice is not None:
            return sample_lattice(lattices, body.lattice, comm.rank, comm.size, radius)
        bounds = np.array([_bounds(lattice) for lattice in lattices])
        return sample_with_weights(lattices, (bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)), comm.rank, comm.size, radius)


def _bounds(lattice):
    """Return (lower, upper), m, of the part of a LatticeBody in its window."""
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
    return Part(comm, make_subdomain_of(scene, body, partition, comm, comm.rank))


def make_subdomain_of(scene, body, partition, comm, leaf):
    """Return this rank's Subdomain of a body, the leaf-th box of the partition. Collective over `comm`.

    Raises
    ------
    SceneError, on every rank of `comm`: bodies whose particles coincide.
    """
    radius, linear = body.reach, scene.particles.kinematics == "linear"

    def describe_points(points, number):
        return describe(scene, body, points, number)

    with agree_on_error(comm):
        try:
            if body.lattice is not None:
                return make_lattice_subdomain(body.lattices, body.lattice, partition, leaf, radius, describe_points, body.law, linear)
            return make_subdomain(body.lattices, partition, leaf, radius, describe_points, linear)
        except ValueError as error:
            raise scene.error("body", str(error), "bodies that do not overlap") from error
