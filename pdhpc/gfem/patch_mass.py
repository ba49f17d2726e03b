"""The mass matrix M^ of the coupled space: consistent on enriched cells, lumped by row sums outside."""
import numpy as np

from pdhpc.gfem import lanes
from pdhpc.parallel.linear_solver import Defaults, LinearSolver


class PatchMass:
    """M^ and its inverse. Where no enriched cell is near it is diagonal; the vertices K of enriched cells share one system, solved by CG with the diagonal.

    The condition number of the scaled matrix of bilinear functions is at most 9, on any mesh: CG halves the error in each iteration.

    Attributes
    ----------
    iterations : of the solver so far. failure : None, or what a solve that did not converge has to say.
    """

    def __init__(self, comm, mesh, material, tolerance=1e-12):
        """comm : handle for LinearSolver. material : LatticeMaterial."""
        self._comm, self.mesh, self.material, self._tolerance = comm, mesh, material, tolerance
        self.iterations, self.failure = 0, None
        self._x, self._product = np.zeros((len(mesh.points), mesh.dim)), np.zeros((len(mesh.points), mesh.dim))

    def follow(self, patches, outside_mass):
        """Set the system up for the present patches. Collective. outside_mass : (n_vertices,), kg, of cells that are not enriched."""
        mesh = self.mesh
        near = patches.touched(patches.enriched)
        self._cells = np.flatnonzero(patches.enriched[: mesh.n_owned_cells]).astype(np.int32)
        self.inner = np.flatnonzero(near[: mesh.n_owned])  # K
        exchange = mesh.exchange.restricted(near)
        self._shared_x, self._shared_product = exchange.bind(self._x), exchange.bind(self._product)
        self._product[:] = 0.0
        diagonals = np.ascontiguousarray(np.einsum("kaa->ka", self.material.consistent))
        lanes.lump(mesh.cells, self._cells, self.material.kind, diagonals, self._product[:, 0])
        self._shared_product.accumulate()
        self._outside = outside_mass[self.inner, None]
        diagonal = np.repeat(self._product[self.inner, :1] + self._outside, mesh.dim, axis=1)
        self._solver = LinearSolver(self._comm, "gfem_", Defaults("cg", self._tolerance), diagonal.size, self._apply, diagonal)

    def _apply(self, x):
        """Return M^ x of the owned vertices of K. Collective over neighbours."""
        self._x[self.inner] = x.reshape(-1, self.mesh.dim)
        self._shared_x.refresh()
        self._product[:] = 0.0
        lanes.multiply_mass(self.mesh.cells, self._cells, self.material.kind, self.material.consistent, self._x, self._product)
        self._shared_product.accumulate()
        return self._product[self.inner] + self._outside * self._x[self.inner]

    def solve(self, right, change):
        """Store M^^-1 right in change at the owned vertices of K; both (n_vertices, dim), right complete at owned vertices. Collective."""
        change[self.inner] = self._solver.solve(right[self.inner].ravel()).reshape(-1, self.mesh.dim)
        self.iterations += self._solver.iterations
        self.failure = self.failure or self._solver.failure

    def condition(self):
        """Return an estimate of the condition number of the scaled matrix on K. Collective."""
        return self._solver.condition()
