"""The particles of a lattice as the points of a mesh's cells: which slots lie in which cell, and the values of its functions there."""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.family import MIXED
from pdhpc.kernels.simd import LANES


_PIECE = 1 << 14


class Points(NamedTuple):
    """The particles of some cells, cell by cell.

    slots (n,) int64, of the particles; cell (n_cells,) int32, local cells of the mesh; start (n_cells + 1,) int64: those of cell c are start[c] ...
    start[c + 1] - 1; shape (n, corners), values of the cell's functions at each; mass (n,), rho V, kg.
    """

    slots: np.ndarray
    cell: np.ndarray
    start: np.ndarray
    shape: np.ndarray
    mass: np.ndarray


class CellLattice:
    """How the lattice of a Subdomain lies in the cells of a box mesh: `ratio` particles along each side of a cell.

    Slots follow from a cell's index by arithmetic; nothing is stored per particle.

    Attributes
    ----------
    spacing, m. origin : (dim,), m, the first cell of the lattice's grid; step, cells : of its LatticeArrays.
    template : (ratio^dim, dim) int64, cells of the lattice in one of the mesh, in the order of slots. shape (ratio^dim, corners), gradient (ratio^dim,
    corners, dim), 1/m: of its functions there. padded : shape and zeros, eight columns. corner_gradient : at the particles in its corners.
    """

    def __init__(self, mesh, subdomain, element, spacing):
        """mesh : fem.mesh.Mesh of a box. subdomain : Subdomain on a lattice whose spacing divides the mesh's cells. element : of fem/elements.py."""
        self.mesh, self._subdomain = mesh, subdomain
        arrays, dim = subdomain.bonds.arrays, mesh.dim
        self.spacing = spacing
        self.ratio = int(round(mesh.cell_size[0] / self.spacing))
        self.template = np.stack(np.meshgrid(*[np.arange(self.ratio)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
        self.step, self.cells = arrays.step[:dim], arrays.cells[:dim]
        self.template = self.template[np.argsort(self.template @ self.step)]  # in the order of slots
        self._number = np.argsort(np.ravel_multi_index(tuple(self.template.T), (self.ratio,) * dim))
        inside = (self.template + 0.5) / self.ratio
        self.shape, self.gradient = element.shape(inside), element.gradient(inside) / mesh.cell_size
        self.padded = np.zeros((len(self.template), LANES))
        self.padded[:, : self.shape.shape[1]] = self.shape
        corners = np.where(np.isin(self.template, (0, self.ratio - 1)).all(axis=1))[0]
        self.corner_gradient = np.ascontiguousarray(self.gradient[corners])
        self.origin = np.array([arrays.coordinate[axis, 0] for axis in range(dim)])

    def slots_of(self, cells):
        """Return (n_cells, ratio^dim) int64: the slots of the particles of local cells, -1 where there is none on this rank. Local."""
        first = self._first(cells)
        slots = np.empty((len(cells), len(self.template)), np.int64)
        _slots_of(first, self.template, self.step, self.cells, self._subdomain.particles.block, slots)
        return slots

    def pieces(self):
        """Yield the owned cells, (n,) int32, in pieces of bounded size: what is made of their particles at once costs little memory."""
        for first in range(0, self.mesh.n_owned_cells, _PIECE):
            yield np.arange(first, min(first + _PIECE, self.mesh.n_owned_cells), dtype=np.int32)

    def cell_of(self, slots):
        """Return (cell, number in it), (n,) each, of owned particles in `slots` (n,). Local."""
        if len(slots) == 0:
            return np.zeros(0, np.int32), np.zeros(0, np.int64)
        places, low = self._subdomain.places_at(slots), self.mesh.points[self.mesh.cells[:1, 0]]
        index = np.rint((places - low) / self.spacing - 0.5).astype(np.int64)  # of the lattice, from the corner of the first cell
        cell = index // self.ratio + np.stack(np.unravel_index(self.mesh.cell_id[:1], self.mesh.counts), axis=1)
        wanted = np.ravel_multi_index(tuple(cell.T), self.mesh.counts)
        owned = self.mesh.cell_id[: self.mesh.n_owned_cells]
        within = index % self.ratio
        number = np.ravel_multi_index(tuple(within.T), (self.ratio,) * self.mesh.dim)
        return np.searchsorted(owned, wanted).astype(np.int32), self._number[number]

    def listed(self, cells):
        """Return (slots int64, cell int32, number in it uint16), (n,) each, of the particles of local cells that this rank holds, cell by cell. Local."""
        cells = np.asarray(cells, np.int32)
        first = self._first(cells)
        most = len(cells) * len(self.template)
        slots, cell, number = np.empty(most, np.int64), np.empty(most, np.int32), np.empty(most, np.uint16)
        n = _list_slots(first, cells, self.template, self.step, self.cells, self._subdomain.particles.block, slots, cell, number)
        return slots[:n], cell[:n], number[:n]

    def _first(self, cells):
        """Return (n, dim) int64, the lowest cell of the lattice, counted from the grid's first, in each of some cells."""
        lower = self.mesh.points[self.mesh.cells[cells, 0]]
        return np.rint((lower + 0.5 * self.spacing - self.origin) / self.spacing).astype(np.int64)

    def points_of(self, cells, density):
        """Return the Points of local cells, every particle that this rank holds; density (n_block,), kg/m^3. Local."""
        slots = self.slots_of(cells)
        there = slots >= 0
        start = np.concatenate(([0], np.cumsum(there.sum(axis=1))))
        particles, chosen = self._subdomain.particles, slots[there]
        mass = density[particles.block[chosen]] * particles.volume[chosen]
        number = np.broadcast_to(np.arange(len(self.template)), slots.shape)[there]
        return Points(chosen, np.asarray(cells, np.int32), start, self.shape[number], mass)


@kernel
def _slots_of(first, template, step, cells, block, slots):
    for c in range(len(first)):
        for p in range(len(template)):
            slot, inside = np.int64(0), True
            for d in range(template.shape[1]):
                index = first[c, d] + template[p, d]
                inside = inside and 0 <= index < cells[d]
                slot += index * step[d]
            slots[c, p] = slot if inside and block[slot] != MIXED else -1


@kernel
def _list_slots(first, chosen, template, step, cells, block, slots, cell, number):
    """As _slots_of, of those that are there, one after the other; return their number."""
    count = 0
    for c in range(len(first)):
        for p in range(len(template)):
            slot, inside = np.int64(0), True
            for d in range(template.shape[1]):
                index = first[c, d] + template[p, d]
                inside = inside and 0 <= index < cells[d]
                slot += index * step[d]
            if inside and block[slot] != MIXED:
                slots[count], cell[count], number[count] = slot, chosen[c], p
                count += 1
    return count


@kernel
def interpolate(cells, cell, number, shape, values, result):
    """Store sum_i N_i values[i] in result (n, width) at particles `number` (n,) of local cells `cell` (n,).

    cells (n_cells, corners); shape (n_points, corners), of CellLattice; values (n_vertices, width).
    """
    for p in range(len(cell)):
        corner = cells[cell[p]]
        for d in range(values.shape[1]):
            total = 0.0
            for a in range(shape.shape[1]):
                total += shape[number[p], a] * values[corner[a], d]
            result[p, d] = total
