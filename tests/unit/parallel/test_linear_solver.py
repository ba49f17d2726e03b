import numpy as np
import pytest

from pdhpc.parallel.linear_solver import Defaults, LinearSolver, MatrixSolver, Rows, SolverError

MATRIX = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])


def test_cg_solves_and_counts(comm):
    solver = LinearSolver(comm, "test_", Defaults("cg", 1e-12), 3, lambda x: MATRIX @ x, np.diag(MATRIX))
    assert MATRIX @ solver.solve(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 2.0, 3.0]) and 1 <= solver.iterations <= 3 and solver.failure is None


def test_richardson_is_a_truncated_sum(comm):
    """Two iterations from zero give D^-1 r + D^-1 (D - A) D^-1 r."""
    solver = LinearSolver(comm, "test_", Defaults("richardson", iterations=2), 3, lambda x: MATRIX @ x, np.diag(MATRIX))
    right, inverse = np.array([1.0, 2.0, 3.0]), np.diag(1 / np.diag(MATRIX))
    assert solver.solve(right) == pytest.approx(inverse @ right + inverse @ (np.diag(np.diag(MATRIX)) - MATRIX) @ inverse @ right, rel=1e-14)
    assert solver.iterations == 2 and solver.failure is None


def test_failure_is_remembered(comm):
    solver = LinearSolver(comm, "test_", Defaults("cg", 1e-12, 1), 3, lambda x: MATRIX @ x, np.diag(MATRIX))
    solver.solve(np.array([1.0, 2.0, 3.0]))
    assert "test_ did not converge in 1 iterations" in solver.failure and "-test_ksp_max_it" in solver.failure


def test_nothing_to_solve(comm):
    assert len(LinearSolver(comm, "test_", Defaults("cg"), 0, lambda x: x, np.empty(0)).solve(np.empty(0))) == 0


def rows_of(matrix):
    """A dense matrix as Rows with every entry."""
    n = len(matrix)
    return Rows(np.arange(0, n * n + 1, n), np.tile(np.arange(n), n), matrix.ravel().copy())


@pytest.mark.parametrize("preconditioner", ("jacobi", "gamg", "none"))
def test_a_matrix_is_solved(comm, preconditioner):
    near_null = np.ones((3, 2)) if preconditioner == "gamg" else None  # the second one depends on the first and is left out
    solver = MatrixSolver(comm, "test_", Defaults("cg", 1e-12, 50, preconditioner), rows_of(MATRIX), 1, near_null)
    x = solver.solve(np.array([1.0, 2.0, 3.0]))
    assert MATRIX @ x == pytest.approx([1.0, 2.0, 3.0]) and solver.residual < 1e-11 and solver.iterations >= 1
    solver.solve(np.array([1.0, 2.0, 3.0]), x)
    assert solver.iterations <= 1


def test_options_of_the_prefix_take_precedence(comm):
    from petsc4py import PETSc

    PETSc.Options()["chosen_ksp_max_it"] = 1
    try:
        with pytest.raises(SolverError, match=r"chosen_ did not converge in 1 iterations \(reason -3, residual norm .*raise -chosen_ksp_max_it"):
            MatrixSolver(comm, "chosen_", Defaults("cg", 1e-12, 50), rows_of(MATRIX)).solve(np.array([1.0, 2.0, 3.0]))
    finally:
        PETSc.Options().delValue("chosen_ksp_max_it")


def test_a_system_without_solution_is_an_error(comm):
    with pytest.raises(SolverError, match="reason -"):
        MatrixSolver(comm, "test_", Defaults("cg", 1e-12, 50), rows_of(np.array([[1.0, -1], [-1, 1]]))).solve(np.array([1.0, 1.0]))
