"""Nodal values of what particles carry: the mean of the particles around a vertex."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.family import MIXED


class VertexMeans:
    """Values at vertices from the 2^dim particles around them; at a straight edge of the body, where half of these are missing, extrapolated linearly."""

    def __init__(self, lattice, subdomain, vertices):
        """lattice : CellLattice. vertices (n,), owned, with all particles around them on this rank, ghosts included. Local."""
        dim = lattice.mesh.dim
        self.vertices = vertices
        self._slots, self._weights = np.zeros((len(vertices), 2**dim), np.int64), np.zeros((len(vertices), 2**dim))
        lower = np.rint((lattice.mesh.points[vertices] - lattice.origin) / lattice.spacing - 0.5).astype(np.int64)
        _find_means(lower, lattice.step, lattice.cells, subdomain.particles.block, self._slots, self._weights)

    def store(self, field, nodal):
        """Store the means of field (n_slots, dim) in nodal (n_vertices, dim). Local."""
        _store_means(self.vertices, self._slots, self._weights, field, nodal)


@kernel
def _is_there(index, step, cells, block):
    slot = np.int64(0)
    for d in range(len(index)):
        if index[d] < 0 or index[d] >= cells[d]:
            return -1
        slot += index[d] * step[d]
    return slot if block[slot] != MIXED else -1


@kernel
def _find_means(lower, step, cells, block, slots, weights):
    """lower (n, dim): the particle below each vertex along every axis."""
    dim = lower.shape[1]
    corners = 2**dim
    index, side = np.empty(dim, np.int64), np.empty(dim, np.int64)
    for n in range(len(lower)):
        count = 0
        side[:] = 0  # bit 0: a particle below along the axis, bit 1: above
        for corner in range(corners):
            for d in range(dim):
                index[d] = lower[n, d] + (corner >> d & 1)
            slot = _is_there(index, step, cells, block)
            if slot >= 0:
                count += 1
                for d in range(dim):
                    side[d] |= 1 << (corner >> d & 1)
        complete = True
        for corner in range(corners):
            weight = 1.0
            for d in range(dim):
                high = corner >> d & 1
                if side[d] == 3:
                    index[d] = lower[n, d] + high
                    weight *= 0.5
                elif side[d] == 1:
                    index[d] = lower[n, d] - high
                    weight *= 1.5 if high == 0 else -0.5
                else:
                    index[d] = lower[n, d] + 1 + high
                    weight *= 1.5 if high == 0 else -0.5
            slot = _is_there(index, step, cells, block)
            complete = complete and slot >= 0
            slots[n, corner], weights[n, corner] = max(slot, 0), weight
        if not complete:
            for corner in range(corners):
                for d in range(dim):
                    index[d] = lower[n, d] + (corner >> d & 1)
                slot = _is_there(index, step, cells, block)
                slots[n, corner], weights[n, corner] = max(slot, 0), 1.0 / max(count, 1) if slot >= 0 else 0.0


@kernel
def _store_means(vertices, slots, weights, field, nodal):
    for n in range(len(vertices)):
        for d in range(nodal.shape[1]):
            total = 0.0
            for c in range(slots.shape[1]):
                total += weights[n, c] * field[slots[n, c], d]
            nodal[vertices[n], d] = total
