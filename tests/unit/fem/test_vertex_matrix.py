import numpy as np
import pytest

from pdhpc.fem import vertex_matrix
from pdhpc.fem.basis import Hats, rigid_motions
from pdhpc.fem.nodes import stars_of
from pdhpc.fem.vertex_matrix import ConstrainedSolver, VertexMatrix
from pdhpc.parallel.linear_solver import Defaults
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, solid


def matrix_of(mesh):
    """(VertexMatrix of 2 K + 3 M, the same dense, assembled entry by entry)."""
    body, dim, n = solid(mesh), mesh.dim, len(mesh.points)
    stiffness, mass = body.stiffness(), body.mass()
    dense = np.zeros((n, dim, n, dim))
    for factor, matrices in ((2.0, stiffness), (3.0, mass)):
        for cell, each in zip(mesh.cells, matrices.matrices[matrices.index]):
            dense[np.ix_(cell, range(dim), cell, range(dim))] += factor * each.reshape(len(cell), dim, len(cell), dim)
    return VertexMatrix(mesh, stars_of(mesh), dim, (2.0, stiffness), (3.0, mass)), dense.reshape(n * dim, -1)


@pytest.mark.parametrize("kind, counts", (("quad", (3, 4)), ("triangle", (3, 2)), ("tetra", (2, 2, 1)), ("hexahedron", (2, 1, 2))))
def test_blocks_are_the_assembled_matrix(comm, kind, counts):
    mesh = general_mesh(comm, kind, counts, 0.2)
    matrix, dense = matrix_of(mesh)
    x = np.random.default_rng(0).standard_normal(mesh.points.shape)
    assert np.allclose(matrix.multiply(x).ravel(), dense @ x.ravel(), atol=1e-13)
    assert np.allclose(matrix.diagonal().ravel(), np.diag(dense))
    for v in range(mesh.n_owned):
        columns = matrix.column[matrix.row_start[v] : matrix.row_start[v + 1]]
        assert (np.diff(mesh.vertex_id[columns]) > 0).all() and v in columns
    rows = matrix.rows(np.zeros(mesh.points.shape, bool))
    scattered = np.zeros_like(dense)
    scattered[np.repeat(np.arange(len(dense)), np.diff(rows.start)), rows.columns] = rows.values
    assert np.allclose(scattered, dense, atol=1e-13)


@pytest.mark.parametrize("preconditioner", ("jacobi", "gamg"))
def test_given_components_are_kept(comm, preconditioner):
    mesh = general_mesh(comm, "triangle", (4, 4), 0.2)
    matrix, dense = matrix_of(mesh)
    rng = np.random.default_rng(1)
    fixed, given, right = rng.random(mesh.points.shape) < 0.3, rng.standard_normal(mesh.points.shape), rng.standard_normal(mesh.points.shape)
    x = ConstrainedSolver(matrix, Hats("triangle"), fixed, "test_", Defaults("cg", 1e-13, 500, preconditioner)).solve(right, given)
    assert np.allclose(x[fixed], given[fixed], rtol=1e-10)
    assert np.abs((dense @ x.ravel() - right.ravel())[~fixed.ravel()]).max() < 1e-10


def test_multigrid_needs_to_know_rotations(comm, monkeypatch):
    """A slender cantilever: a few tens of iterations, several times as many when translations alone are known."""
    mesh = box_mesh(comm, (160, 4), (40.0, 1.0))
    body, counts = solid(mesh), []
    matrix = VertexMatrix(mesh, stars_of(mesh), 2, (1.0, body.stiffness()))
    fixed = np.repeat(mesh.points[:, :1] == 0.0, 2, axis=1)
    for known in (3, 2):
        monkeypatch.setattr(vertex_matrix, "rigid_motions", lambda basis, mesh, known=known: rigid_motions(basis, mesh)[..., :known])
        solver = ConstrainedSolver(matrix, body.basis, fixed, "test_", Defaults("cg", 1e-10, 2000, "gamg"))
        solver.solve(np.where(mesh.points == [40.0, 0.0], 1e-3, 0.0), np.zeros(mesh.points.shape))
        counts.append(solver.solver.iterations)
    assert counts[0] <= 50 and counts[1] > 2 * counts[0], counts
