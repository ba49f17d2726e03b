import numpy as np
import pytest

from pdhpc.gfem.stable_step import coupled_step, lumped_step
from pdhpc.study.verify.case import plate, problem_of

STIFF = """
[[material]]
name = "stiff"
density = 2.0
youngs_modulus = 50.0
[[body]]
name = "beside"
material = "stiff"
shape = "box"
lower = [{right}, -8.0]
upper = [{end}, 8.0]
"""


@pytest.mark.parametrize("extra", ("", STIFF.format(right=12.0, end=20.0)))
def test_step_is_two_over_the_largest_frequency(extra, comm):
    parts = problem_of('model = "gfem"\n' + plate((24, 16), extra="[mesh]\ncell_size = 4.0\n" + extra)).coupled_parts
    solution, n = parts.solution, 2 * len(parts.mesh.points)
    matrix = np.empty((n, n))
    for column in range(n):
        solution.displacement[:] = np.eye(n)[column].reshape(-1, 2)
        solution.evaluate_elements()
        matrix[:, column] = -solution.force.ravel()
    root = np.sqrt(np.repeat(solution.outside_mass, 2))
    exact = 2.0 / np.sqrt(np.linalg.eigvalsh(matrix / root / root[:, None])[-1])
    solution.displacement[:] = 0.25
    found = lumped_step(comm, solution)
    assert found == pytest.approx(exact, rel=1e-3) and found == parts.critical_dt
    assert found >= exact * (1 - 1e-6), "Ritz values lie below the largest eigenvalue"
    assert np.all(solution.displacement == 0.25), "the state is left as it was"
    assert f"{found:.12e}" == f"{found:.6e}".replace("e", "000000e"), "rounded, so that round-off over ranks does not show"


@pytest.mark.parametrize("cell, factor", ((4.0, 1.0), (8.0, (5 / 8) ** 0.5)))
def test_many_particles_in_a_cell_ask_for_smaller_steps(cell, factor, comm):
    """2/omega_max of the mesh up to H = 5 h, times sqrt(5 h/H) beyond."""
    parts = problem_of('model = "gfem"\n' + plate((24, 16), extra=f"[mesh]\ncell_size = {cell}\n")).coupled_parts
    assert parts.critical_dt == coupled_step(comm, parts.solution, int(cell)) == pytest.approx(factor * lumped_step(comm, parts.solution), rel=1e-14)
