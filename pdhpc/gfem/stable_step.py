"""The critical step of a coupled run: that of explicit integration on the mesh alone, by Lanczos' method, less where cells hold many particles."""
import math

import numpy as np
from scipy.linalg import eigh_tridiagonal

from pdhpc.parallel.comm import exact_sum

_STEPS = 80
_KEPT = 1e-6  # relative: to what the step is rounded down, so that round-off of sums over ranks does not show


def coupled_step(comm, solution, ratio):
    """Return the critical step, s, with `ratio` = H/h particles along a cell: 2/omega_max of the mesh, times sqrt(5 h/H) where that is below 1. Collective.

    The second factor is measured, see `pdhpc verify gfem_still`: a crack that stands still gains no energy over 1600 steps of 0.7 to 0.8 of what is returned at
    H/h = 5, 6, 8, 10, 12, 15. Beyond it is left to luck: of the mesh's own step, 0.7 fails at H/h = 10, 0.6 and 0.48 at 15, but not 0.55.
    """
    return lumped_step(comm, solution) * min(1.0, math.sqrt(5.0 / ratio))


def lumped_step(comm, solution):
    """Return 2/omega_max, s, of the elements' stiffness and their lumped mass, no patch chosen. Collective.

    80 steps of Lanczos on M^-1/2 K M^-1/2 from a rough start; the largest Ritz value of the tridiagonal matrix is within 1e-3 of omega_max^2 and below it.
    """
    mesh = solution.mesh
    n, dim = mesh.n_owned, mesh.dim
    root = np.sqrt(solution.outside_mass)[:, None]
    phase = mesh.vertex_id[:n, None] * np.array([0.7548776662, 0.5698402910, 0.8191725134])[:dim]
    v, before, beta = np.modf(phase)[0] - 0.5, np.zeros((n, dim)), 0.0
    v /= math.sqrt(exact_sum(comm, v.ravel() ** 2))
    kept = solution.displacement.copy()
    diagonal, beside = [], []
    for _ in range(min(_STEPS, dim * mesh.n_global_vertices)):
        w = _apply(solution, root, v) - beta * before
        diagonal.append(exact_sum(comm, (v * w).ravel()))
        w -= diagonal[-1] * v
        beta = math.sqrt(exact_sum(comm, w.ravel() ** 2))
        if beta <= 1e-12 * abs(diagonal[0]):
            break
        beside.append(beta)
        before, v = v, w / beta
    solution.displacement[:] = kept
    largest = eigh_tridiagonal(np.array(diagonal), np.array(beside[: len(diagonal) - 1]), eigvals_only=True)[-1]
    step = 2.0 / math.sqrt(largest)
    unit = 10.0 ** math.floor(math.log10(step)) * _KEPT
    return math.floor(step / unit) * unit


def _apply(solution, root, v):
    """Return M^-1/2 K M^-1/2 v of the owned vertices (n_owned, dim). Collective over neighbours."""
    n = len(v)
    solution.displacement[:n] = v / root[:n]
    solution.refresh("displacement")
    solution.evaluate_elements()
    solution.right[:] = -solution.force
    solution.gather_right()
    return solution.right[:n] / root[:n]
