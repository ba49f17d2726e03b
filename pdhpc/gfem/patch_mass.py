"""The mass matrix M^ of the coupled space: consistent on enriched cells, lumped by row sums outside."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.parallel.linear_solver import AssembledSolver, Defaults, first_row


class PatchMass:
    """M^ and its inverse. Where no enriched cell is near it is diagonal; the vertices K of enriched cells share one system, solved by CG with the diagonal.

    The condition number of the scaled matrix of bilinear functions is at most 9/(1 - 1/m^2)^2 with m particles along a cell, on any mesh: CG halves the error
    in each iteration. A row holds 9 entries in 2D; it is assembled by the owner of its vertex, who has all cells around it.

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
        row_of = np.full(len(mesh.points), -1, np.int32)
        row_of[self.inner] = np.arange(len(self.inner))
        chosen = np.flatnonzero(patches.enriched).astype(np.int32)
        most = 3**dim
        columns, values = np.full((len(self.inner), most), -1, np.int64), np.zeros((len(self.inner), most))
        _gather_rows(mesh.cells, chosen, self._mass, row_of, number[:, 0].astype(np.int64), columns, values)
        own = np.argmax(columns == number[self.inner].astype(np.int64), axis=1) if len(self.inner) else np.zeros(0, np.int64)
        values[np.arange(len(self.inner)), own] += outside_mass[self.inner]
        self._solver = _solver_of_components(self._comm, columns, values, dim, self._tolerance)

    def solve(self, right, change):
        """Store M^^-1 right in change at the owned vertices of K; both (n_vertices, dim), right complete at owned vertices. Collective."""
        change[self.inner] = self._solver.solve(right[self.inner].ravel()).reshape(-1, self.mesh.dim)
        self.iterations += self._solver.iterations
        self.failure = self.failure or self._solver.failure

    def condition(self):
        """Return an estimate of the condition number of the scaled matrix on K. Collective."""
        return self._solver.condition()


def _solver_of_components(comm, columns, values, dim, tolerance):
    """Return the solver of a scalar matrix, rows (n, most) with -1 for no entry, for all components at once, a vertex's after each other. Collective."""
    there = np.repeat(columns >= 0, dim, axis=0)
    component = np.tile(np.arange(dim), len(columns))[:, None]
    indptr = np.concatenate(([0], np.cumsum(there.sum(axis=1))))
    solver = AssembledSolver(comm, "gfem_", Defaults("cg", tolerance), indptr, (np.repeat(columns, dim, axis=0) * dim + component)[there])
    solver.fill(np.repeat(values, dim, axis=0)[there])
    return solver


@kernel
def _gather_rows(cells, chosen, mass, row_of, number, columns, values):
    """Sum the masses (n_cells, corners^2) of cells chosen (n,) into rows: columns (n_rows, most) hold the numbers of vertices, in the order they are met."""
    corners = cells.shape[1]
    for n in range(len(chosen)):
        corner = cells[chosen[n]]
        for a in range(corners):
            row = row_of[corner[a]]
            if row < 0:
                continue
            for b in range(corners):
                column, at = number[corner[b]], 0
                while columns[row, at] >= 0 and columns[row, at] != column:
                    at += 1
                columns[row, at] = column
                values[row, at] += mass[chosen[n], a * corners + b]
