"""The mass matrix M^ of the coupled space: consistent on enriched cells, lumped by row sums outside."""
import numpy as np
from scipy.sparse import coo_matrix

from pdhpc.parallel.linear_solver import AssembledSolver, Defaults, first_row


class PatchMass:
    """M^ and its inverse. Where no enriched cell is near it is diagonal; the vertices K of enriched cells share one system, solved by CG with the diagonal.

    The condition number of the scaled matrix of bilinear functions is at most 9/(1 - 1/m^2)^2 with m particles along a cell, on any mesh: CG halves the error in
    each iteration. A row holds 9 entries in 2D; it is assembled by the owner of its vertex, who has all cells around it.

    Attributes
    ----------
    inner : (n,) owned vertices of K. iterations : of the solver so far. failure : None, or what a solve that did not converge has to say.
    """

    def __init__(self, comm, mesh, material, tolerance=1e-12):
        """comm : handle for the solver. material : LatticeMaterial. tolerance : relative. Collective."""
        self._comm, self.mesh, self._tolerance = comm, mesh, tolerance
        self.iterations, self.failure = 0, None
        corners = mesh.cells.shape[1]
        self._mass = np.zeros((len(mesh.cells), corners * corners))
        self._mass[: mesh.n_owned_cells] = material.consistent[material.kind].reshape(-1, corners * corners)
        shared = mesh.cell_exchange.bind(self._mass)
        shared.refresh()
        shared.free()

    def follow(self, patches, outside_mass):
        """Set the system up for the present patches. Collective. outside_mass : (n_vertices,), kg, of cells that are not enriched."""
        mesh, dim = self.mesh, self.mesh.dim
        self.inner = np.flatnonzero(patches.touched(patches.enriched)[: mesh.n_owned])
        number = np.full((len(mesh.points), 1), -1.0)
        number[self.inner, 0] = first_row(self._comm, len(self.inner)) + np.arange(len(self.inner))
        shared = mesh.exchange.bind(number)
        shared.refresh()
        shared.free()
        cells = mesh.cells[patches.enriched]
        corners = cells.shape[1]
        row, column = np.repeat(cells, corners, axis=1).ravel(), np.tile(cells, (1, corners)).ravel()
        mine = row < mesh.n_owned
        local = np.zeros(mesh.n_owned, np.int64)
        local[self.inner] = np.arange(len(self.inner))
        entries = self._mass[patches.enriched].ravel()[mine], (local[row[mine]], number[column[mine], 0].astype(np.int64))
        total = int(self._comm.allreduce(len(self.inner)))
        matrix = coo_matrix(entries, (len(self.inner), max(total, 1))).tocsr()
        matrix += coo_matrix((outside_mass[self.inner], (np.arange(len(self.inner)), number[self.inner, 0].astype(np.int64))), matrix.shape).tocsr()
        matrix.sort_indices()
        self._solver = _solver_of_components(self._comm, matrix, dim, self._tolerance)

    def solve(self, right, change):
        """Store M^^-1 right in change at the owned vertices of K; both (n_vertices, dim), right complete at owned vertices. Collective."""
        change[self.inner] = self._solver.solve(right[self.inner].ravel()).reshape(-1, self.mesh.dim)
        self.iterations += self._solver.iterations
        self.failure = self.failure or self._solver.failure

    def condition(self):
        """Return an estimate of the condition number of the scaled matrix on K. Collective."""
        return self._solver.condition()


def _solver_of_components(comm, matrix, dim, tolerance):
    """Return the solver of a scalar matrix (csr) for all components at once, those of a vertex after each other. Collective."""
    lengths = np.repeat(np.diff(matrix.indptr), dim)
    indptr = np.concatenate(([0], np.cumsum(lengths)))
    start = np.repeat(matrix.indptr[:-1], dim)
    take = np.repeat(start - indptr[:-1], lengths) + np.arange(indptr[-1])
    component = np.repeat(np.tile(np.arange(dim), matrix.shape[0]), lengths)
    solver = AssembledSolver(comm, "gfem_", Defaults("cg", tolerance), indptr, matrix.indices[take].astype(np.int64) * dim + component)
    solver.fill(matrix.data[take])
    return solver
