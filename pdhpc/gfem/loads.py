"""Loads of a coupled run: force densities on the particles, which act through the mesh wherever its cells are not enriched."""
import numpy as np

from pdhpc.conditions.loads import BodyForce
from pdhpc.jit import kernel
from pdhpc.kernels.simd import LANES
from pdhpc.state import Entry


class ParticleLoad:
    """A force density b f(t) on some particles of the lattice.

    slots (n,) int32, owned particles; vector (n, dim), N/m^3, at f = 1; cells (m,) int32, owned cells that hold one of them; nodal (m, corners, dim), N, their
    sum_p V_p N_i b_p. ids (n,) int64, of the particles.
    """

    def __init__(self, lattice, subdomain, slots, vector, time_function):
        """lattice : CellLattice. Local."""
        self.slots, self.vector, self.time_function = slots.astype(np.int32), np.ascontiguousarray(vector, float), time_function
        self.ids = subdomain.particles.ids_at(self.slots)
        self._work, self._acting, self._chosen = np.zeros(len(self.slots)), None, None
        cell, number = lattice.cell_of(self.slots)
        self.cells, at = np.unique(cell, return_inverse=True)
        self.nodal = np.zeros((len(self.cells), lattice.shape.shape[1], lattice.mesh.dim))
        volume = float(subdomain.particles.volume[0]) if len(subdomain.particles.volume) else 0.0
        _sum_in_cells(at, number, lattice.shape, volume, self.vector, self.nodal)

    def within(self, inside):
        """Return the BodyForce on those of its particles that inside (n_slots,) bool marks, with the work done on them so far. Local."""
        work = self.work()
        self._chosen = inside[self.slots]
        self._acting = BodyForce(self.slots[self._chosen], self.vector[self._chosen], self.time_function)
        self._take_work(work)
        return self._acting

    def work(self):
        """Return (n,) J/m^3, done so far on each of its particles while it was inside. Local."""
        if self._acting is not None:
            self._work[self._chosen] = self._acting.work
        return self._work

    def _take_work(self, work):
        """Go on with work (n,), J/m^3, done so far. Local."""
        np.copyto(self._work, work)
        self._acting.work[:] = self._work[self._chosen]

    def work_entry(self):
        """Return the Entry of the work. Local."""
        return Entry(self.work, self._take_work, self.ids)

    def whole(self):
        """Return the BodyForce on all of its particles. Local."""
        return BodyForce(self.slots, self.vector, self.time_function)

    def outside(self, mesh, enriched):
        """Return (n_vertices, dim), N at f = 1, of this rank's owned cells that are not enriched: to be accumulated. Local."""
        result = np.zeros((len(mesh.points), mesh.dim))
        _add_nodal_loads(mesh.cells, self.cells, self.nodal, enriched, result)
        return result


@kernel
def _sum_in_cells(at, number, shape, volume, vector, nodal):
    """nodal[at] += V N b of each particle; at, number (n,), vector (n, dim), nodal (n_cells, corners, dim)."""
    for n in range(len(at)):
        for a in range(shape.shape[1]):
            for d in range(vector.shape[1]):
                nodal[at[n], a, d] += volume * shape[number[n], a] * vector[n, d]


@kernel
def _add_nodal_loads(cells, chosen, nodal, enriched, result):
    """result[vertices] += nodal (n, corners, dim) of cells chosen (n,) that are not enriched."""
    for n in range(len(chosen)):
        if not enriched[chosen[n]]:
            corner = cells[chosen[n]]
            for a in range(len(corner)):
                for d in range(result.shape[1]):
                    result[corner[a], d] += nodal[n, a, d]


class LoadOnLanes:
    """A load on Blended particles inside enriched cells, `count` of them: it acts with the bonds' blended forces, by its own sums over the sub-steps."""

    def __init__(self, force, blended):
        """force : BodyForce on slots. Local."""
        self.time_function = force.time_function
        row = force.indices // LANES * LANES
        at = np.minimum(np.searchsorted(blended.rows, row), max(len(blended.rows) - 1, 0))
        found = (blended.rows[at] == row) if len(blended.rows) else np.zeros(len(row), bool)
        self._row, self._lane, self._vector, self.count = at[found], (force.indices - row)[found], force.vector[found], int(found.sum())

    def add_to(self, blended, first, second):
        """impulse += S1 b, moment += S2 b; S1, s, and S2, s^2, of sub_step_sums."""
        blended.impulse[self._row, :, self._lane] += first * self._vector
        blended.moment[self._row, :, self._lane] += second * self._vector


def sub_step_sums(time_function, start, tau, k):
    """Return (S1, S2) of f over k sub-steps: tau sum_j w_j f(t_j), s, and tau^2 (k f(t_0)/2 + sum_{1 <= j < k} (k - j) f(t_j)), s^2."""
    values = [time_function.value(start + j * tau) for j in range(k + 1)]
    first = tau * (sum(values) - 0.5 * (values[0] + values[-1]))
    second = tau**2 * (0.5 * k * values[0] + sum((k - j) * values[j] for j in range(1, k)))
    return first, second
