"""Probes: a field at the particle or vertex nearest to a point, its mean over a region, or the reaction force of a region."""
import numpy as np

from pdhpc.parallel.comm import exact_sum

UNITS = {"displacement": "m", "velocity": "m/s", "force_density": "N/m^3", "reaction": "N", "stress": "Pa", "strain": "1", "damage": "1"}
_AXES = "xyz"


def components(quantity, dim):
    """Return the names of a quantity's components: displacement_x ..., stress_xx ..., damage."""
    if quantity == "damage":
        return [quantity]
    if quantity in ("stress", "strain"):
        pairs = [(a, a) for a in range(dim)] + [(a, b) for a in range(dim) for b in range(a + 1, dim)]
        return [f"{quantity}_{_AXES[a]}{_AXES[b]}" for a, b in pairs]
    return [f"{quantity}_{_AXES[a]}" for a in range(dim)]


class Probe:
    """Mean over some particles or vertices (one of them: a point probe), or the reaction force R = - sum V f over a region.

    f is the total force density (bonds and loads), so R is the force that the support of a held region exerts on the body, apart from the region's inertia.
    """

    def __init__(self, comm, name, quantity, members, dim, supports=None):
        """members (n,) int, of the stepper's view, on this rank. supports : None, or (m,) vertices that are held, whose forces make a reaction. Collective."""
        self.comm, self.quantity, self.members, self.dim, self.supports = comm, quantity, members, dim, supports
        self.count = comm.allreduce(len(members))
        self.columns = tuple(f"{name}.{component} [{UNITS[quantity]}]" for component in components(quantity, dim))

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        if self.quantity == "reaction":
            if self.supports is None:
                values = -stepper.view.field("force_density")[self.members] * stepper.view.volume[self.members, None]
            else:
                values = stepper.view.support_forces(self.supports)
            return [exact_sum(self.comm, values[:, axis]) for axis in range(self.dim)]
        values = self._components(stepper.view.field(self.quantity)[self.members])
        return [exact_sum(self.comm, column) / self.count for column in values]

    def _components(self, values):
        if values.ndim == 1:
            return [values]
        if values.ndim == 2:
            return list(values.T)
        pairs = [(a, a) for a in range(self.dim)] + [(a, b) for a in range(self.dim) for b in range(a + 1, self.dim)]
        return [values[:, a, b] for a, b in pairs]


def nearest_point(comm, view, point):
    """Return (n,) int: the particle or vertex of the View nearest to `point` on the rank that has it, empty elsewhere; ties go to the lowest id. Collective."""
    offset = view.places() - np.asarray(point)
    distance2 = np.einsum("nd,nd->n", offset, offset)
    best = int(np.argmin(distance2)) if len(distance2) else -1
    mine = (float(distance2[best]), int(view.ids[best]), comm.rank) if best >= 0 else (np.inf, 0, comm.rank)
    winner = comm.allreduce(mine, op=min)
    return np.array([best] if winner[2] == comm.rank and best >= 0 else [], dtype=np.int64)
