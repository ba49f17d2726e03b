import numpy as np
import pytest

from pdhpc.parallel.linear_solver import AssembledSolver, Defaults, LinearSolver, MatrixSolver, OptionError, Rows, SolverError, first_row, start_petsc

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


@pytest.mark.parametrize("matrix, most, words", [
    (np.diag([1.0, -0.1, 2.0]), 3, "the matrix is not positive definite (reason -10); look for parts that nothing holds"),
    (np.diag([np.nan, 1.0, 1.0]), 3, "a number is not finite (reason -9); look for moduli"),
    (MATRIX, 1, "the iterations are used up (reason -3); raise -reason_ksp_max_it"),
])
def test_failures_say_what_petsc_means(comm, matrix, most, words):
    rows = Rows(np.arange(0, 10, 3), np.tile(np.arange(3), 3), matrix.ravel())
    solver = MatrixSolver(comm, "reason_", Defaults("cg", 1e-12, most, "none"), rows)
    with pytest.raises(SolverError) as caught:
        solver.solve(np.array([1.0, 2.0, 3.0]))
    assert words in str(caught.value), caught.value


def blocks_of(matrix):
    """Inverses of its diagonal blocks of 2 x 2."""
    return np.array([np.linalg.inv(matrix[k : k + 2, k : k + 2]) for k in range(0, len(matrix), 2)])


def test_blocks_precondition(comm):
    """A matrix of nothing but its blocks is solved in one iteration; other blocks can be given later."""
    matrix = np.kron(np.diag([1.0, 100.0]), [[2.0, 1.0], [1.0, 3.0]])
    solver = LinearSolver(comm, "test_", Defaults("cg", 1e-12), 4, lambda x: matrix @ x, np.tile(np.eye(2), (2, 1, 1)))
    right = np.array([1.0, 2.0, 3.0, 4.0])
    assert matrix @ solver.solve(right) == pytest.approx(right) and solver.iterations > 1
    solver.precondition(blocks_of(matrix))
    assert matrix @ solver.solve(right) == pytest.approx(right) and solver.iterations == 1
    assert LinearSolver(comm, "test_", Defaults("minres", 1e-12), 4, lambda x: matrix @ x, blocks_of(matrix)).solve(right) == pytest.approx(np.linalg.solve(matrix, right))


def test_a_solve_aims_as_told_unless_an_option_says_otherwise(comm):
    from petsc4py import PETSc

    random = np.random.default_rng(0).standard_normal((40, 40))
    matrix, right = random @ random.T + np.eye(40), np.ones(40)
    solver, counts = LinearSolver(comm, "test_", Defaults("cg"), 40, lambda x: matrix @ x, np.ones(40)), []
    for tolerance in (1e-1, 1e-9):
        solver.aim(tolerance)
        solver.solve(right)
        counts.append(solver.iterations)
    assert counts[0] < counts[1]
    PETSc.Options()["test_ksp_rtol"] = 1e-9
    try:
        solver.aim(1e-1)
        solver.solve(right)
    finally:
        PETSc.Options().delValue("test_ksp_rtol")
    assert solver.iterations == counts[1]


def test_nothing_to_solve(comm):
    assert len(LinearSolver(comm, "test_", Defaults("cg"), 0, lambda x: x, np.empty(0)).solve(np.empty(0))) == 0


def test_condition_is_that_of_the_scaled_matrix(comm):
    solver = LinearSolver(comm, "test_", Defaults("cg", 1e-12), 3, lambda x: MATRIX @ x, np.diag(MATRIX))
    scale = 1 / np.sqrt(np.diag(MATRIX))
    assert solver.condition() == pytest.approx(np.linalg.cond(MATRIX * scale * scale[:, None]), rel=1e-6)
    assert MATRIX @ solver.solve(np.ones(3)) == pytest.approx(np.ones(3)) and solver.failure is None, "the solver itself is as before"
    assert LinearSolver(comm, "test_", Defaults("cg"), 0, lambda x: x, np.empty(0)).condition() == 1.0


def assembled(comm, iterations=200):
    """The solver on MATRIX, filled, with the zeros of its corners left out."""
    indptr, columns = np.array([0, 2, 5, 7]), np.array([0, 1, 0, 1, 2, 1, 2])
    solver = AssembledSolver(comm, "rows_", Defaults("cg", 1e-12, iterations), indptr, columns)
    solver.fill(np.ones(7))
    solver.fill(MATRIX[np.repeat(np.arange(3), np.diff(indptr)), columns])
    return solver


def test_assembled_rows_are_solved_and_refilled(comm):
    solver, right = assembled(comm), np.array([1.0, 2.0, 3.0])
    x = solver.solve(right)
    assert MATRIX @ x == pytest.approx(right) and solver.iterations == 3 and solver.failure is None
    assert solver.solve(right, -1e6 * x) == pytest.approx(x) and solver.iterations == 0, "the iteration starts from the multiple of the guess that is best"
    scale = 1 / np.sqrt(np.diag(MATRIX))
    assert solver.condition() == pytest.approx(np.linalg.cond(MATRIX * scale * scale[:, None]), rel=1e-6)


def test_rows_of_zeros_suit_preconditioners_that_divide_by_the_diagonal(comm):
    from petsc4py import PETSc

    PETSc.Options()["zeros_pc_type"] = "sor"
    solver = AssembledSolver(comm, "zeros_", Defaults("cg", 1e-12), np.array([0, 2, 4, 5]), np.array([0, 1, 0, 1, 2]))
    assert solver.solve(np.zeros(3)).tolist() == [0.0, 0.0, 0.0], "rows that were never filled as well"
    solver.fill(np.array([4.0, 1.0, 1.0, 3.0, 0.0]))
    assert solver.solve(np.array([1.0, 2.0, 0.0])) == pytest.approx([1 / 11, 7 / 11, 0.0])
    PETSc.Options().delValue("zeros_pc_type")


def test_assembled_failure_is_remembered(comm):
    solver = assembled(comm, 1)
    solver.solve(np.array([1.0, 2.0, 3.0]))
    assert "rows_ did not converge in 1 iterations" in solver.failure


def test_no_rows(comm):
    solver = AssembledSolver(comm, "rows_", Defaults("cg"), np.zeros(1, int), np.empty(0, int))
    solver.fill(np.empty(0))
    assert len(solver.solve(np.empty(0))) == 0 and solver.condition() == 1.0 and first_row(comm, 5) == 0


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
        with pytest.raises(SolverError, match=r"chosen_ did not converge in 1 iterations, residual norm .* \(reason -3\); raise -chosen_ksp_max_it"):
            MatrixSolver(comm, "chosen_", Defaults("cg", 1e-12, 50), rows_of(MATRIX)).solve(np.array([1.0, 2.0, 3.0]))
    finally:
        PETSc.Options().delValue("chosen_ksp_max_it")


@pytest.mark.parametrize("option, value, words", [
    ("ksp_type", "nosuch", "-refused_ksp_type nosuch: Unable to find requested KSP type nosuch"),
    ("pc_type", "nosuch", "-refused_pc_type nosuch: Unable to find requested PC type nosuch"),
    ("ksp_rtol", "abc", "-refused_ksp_rtol abc: Input string abc has no numeric value"),
    ("pc_type", "LU", "-refused_pc_type LU: Unable to find requested PC type LU"),
    ("ksp_type", None, "-refused_ksp_max_it 7, -refused_ksp_type: Unable to find requested KSP type"),
])
def test_options_that_petsc_does_not_take_are_named(comm, option, value, words):
    """One whose value PETSc's word repeats, or else all of the prefix."""
    from petsc4py import PETSc

    options = PETSc.Options("refused_")
    options["ksp_max_it"], options[option] = 7, value
    makers = (lambda: MatrixSolver(comm, "refused_", Defaults("cg"), rows_of(MATRIX)), lambda: LinearSolver(comm, "refused_", Defaults("cg"), 3, lambda x: x, np.ones(3)),
              lambda: AssembledSolver(comm, "refused_", Defaults("cg"), np.arange(4), np.arange(3)))
    try:
        for make in makers:
            with pytest.raises(OptionError, match=f"^PETSc does not take {words}$"):
                make()
    finally:
        options.delValue("ksp_max_it")
        options.delValue(option)


def test_options_that_do_not_fit_the_system(comm):
    from petsc4py import PETSc

    options = PETSc.Options("refused_")
    options["ksp_max_it"], options["pc_type"] = 7, "lu"
    try:
        with pytest.raises(OptionError, match="PETSc does not take -refused_pc_type lu: Could not locate a solver type for factorization type LU"):
            LinearSolver(comm, "refused_", Defaults("cg"), 3, lambda x: x, np.ones(3))
        assert len(LinearSolver(comm, "refused_", Defaults("cg"), 0, lambda x: x, np.ones(0)).solve(np.ones(0))) == 0, "a system without unknowns"
        with pytest.raises(PETSc.Error, match="matrix of type MATIS"):
            MatrixSolver(comm, "other_", Defaults("cg", preconditioner="bddc"), rows_of(MATRIX))
    finally:
        options.delValue("ksp_max_it")
        options.delValue("pc_type")


def test_a_system_without_solution_is_an_error(comm):
    with pytest.raises(SolverError, match="reason -"):
        MatrixSolver(comm, "test_", Defaults("cg", 1e-12, 50), rows_of(np.array([[1.0, -1], [-1, 1]]))).solve(np.array([1.0, 1.0]))


def test_petsc_starts_once(comm):
    start_petsc()
    start_petsc()
