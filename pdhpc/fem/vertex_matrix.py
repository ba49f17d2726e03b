"""A sparse matrix of blocks between vertices: rows of owned vertices, assembled from all cells around them, so that no entry is sent to another rank."""
import numpy as np

from pdhpc.fem.basis import rigid_motions
from pdhpc.kernels import cells as loops
from pdhpc.parallel.linear_solver import MatrixSolver, Rows


class VertexMatrix:
    """A = sum of factor times cell matrices, with width x width blocks.

    Entries and products have the same bits on any number of ranks: cells and columns are taken in ascending global id.

    Attributes
    ----------
    mesh : Mesh. width : unknowns per vertex. row_start (n_owned + 1,) int64, column (n,) int32 local vertices, value (n, width, width).
    """

    def __init__(self, mesh, stars, width, *terms):
        """stars : Stars of the mesh. terms : (factor, CellMatrices) pairs. Local."""
        self.mesh, self.width = mesh, width
        start, cell, _ = stars
        self.row_start = np.zeros(mesh.n_owned + 1, np.int64)
        loops.count_columns(mesh.cells, start, cell, len(mesh.points), self.row_start)
        self.column = np.empty(self.row_start[-1], np.int32)
        loops.list_columns(mesh.cells, start, cell, mesh.vertex_id, self.row_start, self.column)
        self.value = np.zeros((len(self.column), width, width))
        for factor, matrices in terms:
            loops.add_matrices(mesh.cells, tuple(stars), matrices.index, matrices.table, float(factor), self.row_start, self.column, self.value)

    def multiply(self, x):
        """Return A x (n_owned, width); x (n_vertices, width), ghosts up to date. Local."""
        y = np.empty((self.mesh.n_owned, self.width))
        loops.multiply_blocks(self.row_start, self.column, self.value, np.ascontiguousarray(x), y)
        return y

    def diagonal(self):
        """Return (n_owned, width), the diagonal. Local."""
        row = np.repeat(np.arange(self.mesh.n_owned), np.diff(self.row_start))
        blocks = self.value[self.column == row]
        return np.ascontiguousarray(np.diagonal(blocks, axis1=1, axis2=2))

    def rows(self, fixed):
        """Return Rows whose fixed rows and columns hold the diagonal alone; fixed (n_vertices, width) bool, ghosts up to date. Collective."""
        size = len(self.column) * self.width**2
        start, columns, values = np.zeros(self.mesh.n_owned * self.width + 1, np.int64), np.empty(size, np.int64), np.empty(size)
        loops.scalar_rows(self.row_start, self.column, self.value, fixed, _global_numbers(self.mesh), start, columns, values)
        return Rows(start, columns, values)


class ConstrainedSolver:
    """A x = b with some components of x given: the rows and columns of these are replaced by their diagonal, b by b - A x_given."""

    def __init__(self, matrix, basis, fixed, prefix, defaults):
        """matrix : VertexMatrix. basis : of its cells. fixed (n_owned, width) bool. prefix, defaults : as MatrixSolver. Collective over the mesh's ranks."""
        self.matrix, self.fixed = matrix, np.array(fixed, bool)
        mesh = matrix.mesh
        self.x = np.zeros((len(mesh.points), matrix.width))
        self._ghosts = mesh.exchange.bind(self.x)
        self.x[: mesh.n_owned] = fixed
        self._ghosts.refresh()
        self._diagonal = matrix.diagonal()
        near_null = None
        if defaults.preconditioner == "gamg":
            motions = rigid_motions(basis, mesh)[: mesh.n_owned]
            near_null = motions.reshape(mesh.n_owned * matrix.width, motions.shape[2])
        self.solver = MatrixSolver(mesh.comm, prefix, defaults, matrix.rows(self.x > 0.0), matrix.width, near_null)

    def solve(self, right, given):
        """Return x (n_vertices, width), ghosts up to date, an array that the next solve overwrites. Collective over the mesh's ranks.

        right (n_owned, width); given (n_owned, width), read where components are fixed.

        Raises
        ------
        SolverError: as MatrixSolver.solve.
        """
        n = self.matrix.mesh.n_owned
        self.x[:n] = np.where(self.fixed, given, 0.0)
        self._ghosts.refresh()
        lifted = np.where(self.fixed, self._diagonal * self.x[:n], right - self.matrix.multiply(self.x))
        self.x[:n] = self.solver.solve(lifted.ravel()).reshape(n, self.matrix.width)
        self._ghosts.refresh()
        return self.x


def _global_numbers(mesh):
    """Return (n_vertices,) int64: owned vertices numbered rank after rank. Collective over the mesh's ranks."""
    counts = np.array(mesh.comm.allgather(mesh.n_owned))
    numbers = np.zeros((len(mesh.points), 1), np.int64)
    numbers[: mesh.n_owned, 0] = counts[: mesh.comm.rank].sum() + np.arange(mesh.n_owned)
    bound = mesh.exchange.bind(numbers)
    bound.refresh()
    bound.free()
    return numbers[:, 0]
