import numpy as np
import pytest

from pdhpc.parallel.linear_solver import Defaults, LinearSolver

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
