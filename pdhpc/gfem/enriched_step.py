"""The critical step of explicit integration in an enriched space, by Lanczos' method."""
import math

import numpy as np
from scipy.linalg import eigh_tridiagonal

from pdhpc.parallel.comm import exact_sum

_STEPS = 25


def enriched_step(comm, start, respond, masses):
    """Return 2/omega_max, s, of a linear system M a = -K u; infinite when it has no stiffness. Collective.

    _STEPS steps of Lanczos' method in the inner product of M from a rough start: the largest Ritz value is below omega_max^2, and within some percent of it.

    Parameters
    ----------
    start : list of arrays that together are one u, such as its values at vertices and at points. respond : function u -> M^-1 K u, lists of arrays alike.
    masses : list of arrays, (n, 1) each, kg: u . M u = sum m |u|^2, over this rank's own rows; what is 0 does not count.
    """
    diagonal, beside = [], []
    size = math.sqrt(_inner(comm, masses, start, start))
    if size == 0.0:
        return math.inf
    u, before, beta = [part / size for part in start], [np.zeros_like(part) for part in start], 0.0
    for _ in range(_STEPS):
        w = respond(u)
        diagonal.append(_inner(comm, masses, u, w))
        w = [next_ - diagonal[-1] * now - beta * last for next_, now, last in zip(w, u, before)]
        beta = math.sqrt(max(0.0, _inner(comm, masses, w, w)))
        if beta <= 1e-10 * abs(diagonal[0]):
            break
        beside.append(beta)
        before, u = u, [part / beta for part in w]
    largest = eigh_tridiagonal(np.array(diagonal), np.array(beside[: len(diagonal) - 1]), eigvals_only=True)[-1]
    return 2.0 / math.sqrt(largest) if largest > 0.0 else math.inf


def _inner(comm, masses, one, other):
    """Return sum m one . other over all ranks. Collective."""
    return exact_sum(comm, np.concatenate([(m * a * b).ravel() for m, a, b in zip(masses, one, other)]))
