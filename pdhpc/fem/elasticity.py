"""Linear elasticity on a mesh: the matrices of its cells. Equal cells of a box share one, other cells have one each."""
from typing import NamedTuple

import numpy as np

from pdhpc.fem.basis import Hats
from pdhpc.fem.moduli import PAIRS, checked
from pdhpc.kernels import cells as loops
from pdhpc.kernels.simd import LANES


class CellMatrices(NamedTuple):
    """Symmetric matrices of cells: that of local cell c is table[index[c], :, :n].

    table (n_kind, n, padded) float: n unknowns of a cell, corner by corner, rows padded with zeros to a multiple of 8. index (n_cells,) int32.
    """

    table: np.ndarray
    index: np.ndarray

    @classmethod
    def of(cls, matrices, index):
        """Pad matrices (n_kind, n, n). Local."""
        n = matrices.shape[1]
        table = np.zeros((len(matrices), n, -(-n // LANES) * LANES))
        table[:, :, :n] = matrices
        return cls(table, np.ascontiguousarray(index, np.int32))

    @property
    def matrices(self):
        """(n_kind, n, n), without padding."""
        return self.table[:, :, : self.table.shape[1]]


class Elasticity:
    """rho u'' = div(C sym grad u) + b on a mesh, in a basis of each cell.

    Attributes
    ----------
    mesh : Mesh. basis : Hats or FlatTop. moduli (n_kind, v, v), Pa. density (n_kind,), kg/m^3. kind (n_cells,) int32. thickness : m, 1 in 3D.
    width : unknowns per vertex, numbered (function of the basis, component).
    """

    def __init__(self, mesh, moduli, density, kind=None, thickness=1.0, basis=None):
        """Describe the material; all arrays are local, and no message is sent.

        Parameters
        ----------
        moduli : (v, v) or (n_kind, v, v), Pa (see moduli.py). density : float or (n_kind,), kg/m^3.
        kind : (n_cells,) int, the kind of each local cell, ghosts included; all are 0 without.
        basis : of a cell; Hats of the mesh's cells without.

        Raises
        ------
        ValueError: as moduli.checked; a density or a thickness that is not above 0; a kind that there is not.
        """
        self.mesh, self.basis = mesh, Hats(mesh.kind) if basis is None else basis
        self.moduli = checked(moduli, mesh.dim)
        self.density = np.broadcast_to(np.asarray(density, float), len(self.moduli)).copy()
        self.thickness = float(thickness) if mesh.dim == 2 else 1.0
        self.kind = np.zeros(len(mesh.cells), np.int32) if kind is None else np.ascontiguousarray(kind, np.int32)
        if not (self.density > 0.0).all() or not self.thickness > 0.0:
            raise ValueError(f"densities {self.density.tolist()} kg/m^3 and thickness {self.thickness} m: all must be above 0")
        if self.kind.shape != (len(mesh.cells),) or len(self.kind) and not 0 <= self.kind.min() <= self.kind.max() < len(self.moduli):
            raise ValueError(f"kinds of cells: {len(mesh.cells)} numbers from 0 to {len(self.moduli) - 1} are needed")
        self.width = self.basis.functions * mesh.dim

    @property
    def tensors(self):
        """(n_kind, dim, dim, dim, dim), Pa: the moduli as tensors."""
        dim = self.mesh.dim
        place = np.empty((dim, dim), int)
        for number, (a, b) in enumerate(PAIRS[dim]):
            place[a, b] = place[b, a] = number
        return self.moduli[:, place[:, :, None, None], place[None, None]]

    def shapes(self):
        """Return (points, cells, kind, index): one cell for each matrix that is needed, and which of them each local cell has. Local."""
        if self.mesh.cell_size is None:
            return self.mesh.points, self.mesh.cells, self.kind, np.arange(len(self.kind), dtype=np.int32)
        element = self.basis.element
        corners = np.tile(np.arange(element.corners, dtype=np.int32), (len(self.moduli), 1))
        return element.places * self.mesh.cell_size, corners, np.arange(len(self.moduli), dtype=np.int32), self.kind

    def stiffness(self):
        """Return the stiffness of the cells as CellMatrices, N/m. Local.

        Raises
        ------
        ValueError: a cell is turned inside out.
        """
        points, cells, kind, index = self._checked_shapes()
        xi, weights = self.basis.quadrature
        size = self.basis.element.corners * self.width
        matrices = np.empty((len(cells), size, size))
        loops.stiffnesses(points, cells, self.basis.element.gradient(xi), self.basis.gradient(xi), self.thickness * weights, self.tensors, kind, matrices)
        return CellMatrices.of(0.5 * (matrices + matrices.transpose(0, 2, 1)), index)

    def mass(self):
        """Return the consistent mass of the cells as CellMatrices, kg. Local."""
        scalar, index = self._scalar_mass()
        n = scalar.shape[1]
        full = np.zeros((len(scalar), n, self.mesh.dim, n, self.mesh.dim))
        for axis in range(self.mesh.dim):
            full[:, :, axis, :, axis] = scalar
        return CellMatrices.of(full.reshape(len(scalar), n * self.mesh.dim, n * self.mesh.dim), index)

    def lumped_rows(self):
        """Return (rows (n, n_basis), kg, index (n_cells,)): the row sums of the cells' mass matrices. Local."""
        scalar, index = self._scalar_mass()
        return scalar.sum(axis=2), index

    def lumped_mass(self, stars):
        """Return (n_owned,), kg: the row sums of the mass matrix at owned vertices, summed over cells in ascending id. Local."""
        rows, index = self.lumped_rows()
        result = np.zeros((self.mesh.n_owned, 1))
        loops.gather(*stars, rows[index], np.arange(self.mesh.n_owned, dtype=np.int32), 1.0, result)
        return result[:, 0]

    def _scalar_mass(self):
        """Return ((n, n_basis, n_basis), kg, index): the mass matrices of one component."""
        points, cells, kind, index = self._checked_shapes()
        xi, weights = self.basis.quadrature
        count = self.basis.element.corners * self.basis.functions
        matrices = np.empty((len(cells), count, count))
        loops.masses(points, cells, self.basis.element.gradient(xi), self.basis.shape(xi), self.thickness * weights, self.density, kind, matrices)
        return matrices, index

    def _checked_shapes(self):
        points, cells, kind, index = self.shapes()
        xi, weights = self.basis.element.gauss
        bad = loops.measure(points, cells, self.basis.element.gradient(xi), np.tile(weights, (len(cells), 1)))
        if bad >= 0:
            raise ValueError(f"cell {int(self.mesh.cell_id[bad])} is turned inside out or flat: its corners are {points[cells[bad]].tolist()}")
        return points, cells, kind, index
