"""Communicators, errors that every rank agrees on, and sums that do not depend on the number of ranks."""
import contextlib
import math
import sys
import traceback

import numpy as np


def world():
    """Return MPI.COMM_WORLD; an uncaught exception on one rank then ends the whole job. Local."""
    from mpi4py import MPI

    _install_abort_hook(MPI.COMM_WORLD)
    return MPI.COMM_WORLD


def _install_abort_hook(comm):
    """Let an uncaught exception on any rank abort all of them; otherwise the others wait for ever."""
    if comm.size == 1 or getattr(sys.excepthook, "aborts_mpi", False):
        return

    def abort(kind, error, trace):
        sys.stderr.write(f"rank {comm.rank} of {comm.size}:\n")
        traceback.print_exception(kind, error, trace)
        sys.stderr.flush()
        comm.Abort(1)

    abort.aborts_mpi = True
    sys.excepthook = abort


@contextlib.contextmanager
def agree_on_error(comm):
    """Run a block of local work; when it fails on any rank, raise the error of the lowest failing rank on every rank.

    Collective over `comm`: the block itself must not call MPI, or a rank that failed would leave the others waiting inside it.
    """
    error = None
    try:
        yield
    except Exception as caught:
        error = caught
    failing = comm.allreduce(comm.rank if error is not None else comm.size, op=_op("MIN"))
    if failing == comm.size:
        return
    agreed = comm.bcast(error, root=failing)
    if comm.rank == failing:
        raise error
    raise agreed


def on_root(comm, action, *args):
    """Return `action(*args)` as computed on rank 0, on every rank; its exception is raised on every rank. Collective."""
    outcome = failure = None
    if comm.rank == 0:
        try:
            outcome = action(*args)
        except Exception as caught:
            failure = caught
    outcome, failure = comm.bcast((outcome, failure), root=0)
    if failure is not None:
        raise failure
    return outcome


def _op(name):
    from mpi4py import MPI

    return getattr(MPI, name)


def exact_sum(comm, values):
    """Sum `values` over all ranks so that neither their order nor their spread over ranks changes a bit. Collective.

    Each value is split into two integers on one common grid set by the largest magnitude; integers add exactly in any order. With N values in all the
    result is within N 2^-(2b) of the exact sum relative to the largest magnitude, b = 61 - ceil(log2 N), so better than 1e-24 for a million values.

    Parameters
    ----------
    values : (n,) float array, any unit, n may differ between ranks.

    Returns
    -------
    float; NaN when any value on any rank is not finite.
    """
    values = np.ascontiguousarray(values, dtype=float).ravel()
    largest = float(np.max(np.abs(values))) if values.size else 0.0
    count, largest_anywhere, finite = comm.allreduce(np.array([values.size, 0.0]))[0], 0.0, True
    largest_anywhere = comm.allreduce(largest if math.isfinite(largest) else math.inf, op=_op("MAX"))
    finite = math.isfinite(largest_anywhere)
    if not finite:
        return math.nan
    if largest_anywhere == 0.0:
        return 0.0
    bits = 61 - max(1, math.ceil(math.log2(count + 1)))
    exponent = math.frexp(largest_anywhere)[1]
    coarse = np.rint(np.ldexp(values, bits - exponent))
    rest = values - np.ldexp(coarse, exponent - bits)
    fine = np.rint(np.ldexp(rest, 2 * bits - exponent))
    parts = np.array([coarse.astype(np.int64).sum(), fine.astype(np.int64).sum()], dtype=np.int64)
    total = comm.allreduce(parts)
    return _scaled((int(total[0]) << bits) + int(total[1]), exponent - 2 * bits)


def _scaled(integer, exponent):
    """Return integer * 2**exponent, correctly rounded, for integers wider than a float."""
    surplus = max(0, integer.bit_length() - 1000)
    return math.ldexp(float(integer >> surplus), exponent + surplus)
