"""The padded grid of cells that holds one rank's part of a lattice: which cell lies in which slot."""
import numpy as np

from pdhpc.kernels.motion import Rows
from pdhpc.kernels.simd import LANES

_SLACK = 64  # slots behind the last cell: a block of eight may start in the last row and reach past it
_ALIASED = 512  # doubles in a page: rows or planes that start at multiples of it would compete for the same cache lines


class Grid:
    """Cells first ... last - 1 of a CommonLattice along each axis, with `reach` more on every side.

    The longest axis is the fastest, so that blocks of eight along it are full; its rows start at a multiple of eight slots.

    Attributes
    ----------
    first, last : (dim,) int64, the owned cells. step, cells : (3,) int64, slots between cells and number of cells along x, y, z.
    n_slots : int. coordinate : (3, most cells), m. fastest : axis, 0 to dim - 1.
    """

    def __init__(self, lattice, first, last, reach):
        self.lattice, self.first, self.last, self.reach = lattice, first, last, reach
        dim, extent = len(first), np.maximum(last - first, 0)
        order = np.argsort(extent, kind="stable")  # slowest to fastest
        self.fastest = int(order[-1])
        self.pad = np.full(dim, reach, dtype=np.int64)  # cells before the owned ones
        self.pad[self.fastest] = -(-reach // LANES) * LANES
        self.cells, self.step = np.ones(3, np.int64), np.ones(3, np.int64)
        self.cells[:dim] = self.pad + extent + reach
        self.cells[self.fastest] += -self.cells[self.fastest] % LANES
        self.n_slots = 1
        for axis in order[::-1]:
            self.step[axis] = self.n_slots
            if axis != order[0] and self.n_slots * self.cells[axis] % _ALIASED == 0:
                self.cells[axis] += LANES if axis == self.fastest else 1
            self.n_slots *= int(self.cells[axis])
        if dim == 2:
            self.step[2] = self.n_slots
        self.n_slots += _SLACK
        self.n_slots += -self.n_slots % LANES
        self.coordinate = np.zeros((3, int(self.cells.max())))
        for axis in range(dim):
            start = first[axis] - self.pad[axis]
            self.coordinate[axis, : self.cells[axis]] = lattice.centre(axis, start, start + self.cells[axis])

    def bounds(self):
        """Return (lower, upper), m, planes between cells around the owned cells and `reach` more."""
        origin, spacing = self.lattice.origin, self.lattice.spacing
        return origin + (self.first - self.reach) * spacing, origin + (self.last + self.reach) * spacing

    def slots(self, slab, shift):
        """Return (n,) int32, the slots of the particles of a geometry.lattice.Slab whose cells lie `shift` (dim,) cells into the lattice."""
        step = self.step[: len(shift)]
        return slab.number(step, int((shift - self.first + self.pad) @ step)).astype(np.int32)

    def owns(self, slab, shift):
        """Return (n,) bool, whether the particles of a Slab lie in the cells first ... last - 1."""
        return slab.within(self.first - shift, self.last - shift)

    def offsets(self, stencil):
        """Return (n,) int64, the slots between a particle and its neighbours stencil (n, dim)."""
        return stencil @ self.step[: stencil.shape[1]]

    def rows(self, one_density):
        """Return the Rows of the owned cells."""
        dim, fast = len(self.first), self.fastest
        across = [axis for axis in range(dim) if axis != fast]
        extent = np.maximum(self.last - self.first, 0)
        index = np.stack(np.meshgrid(*[np.arange(extent[axis]) for axis in across], indexing="ij"), axis=-1).reshape(-1, len(across))
        index = index + self.pad[across]
        corner = np.zeros((len(index), dim))
        for column, axis in enumerate(across):
            corner[:, axis] = self.coordinate[axis, index[:, column]]
        start = index @ self.step[across] + self.pad[fast]
        order = np.argsort(start, kind="stable")
        along = self.coordinate[fast, self.pad[fast] : self.pad[fast] + extent[fast]].copy()
        return Rows(start[order], int(extent[fast]), fast, along, corner[order], one_density)
