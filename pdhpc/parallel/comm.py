"""Communicators, errors that every rank agrees on, and sums that do not depend on the number of ranks."""
import contextlib
import math
import sys
import traceback

import numpy as np

from pdhpc.jit import kernel


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


def smallest(comm, value):
    """Return the smallest of the ranks' values. Collective."""
    return comm.allreduce(value, op=_op("MIN"))


def largest(comm, value):
    """Return the largest of the ranks' values. Collective."""
    return comm.allreduce(value, op=_op("MAX"))


def join_marks(comm, marks):
    """Set in `marks`, a uint8 array of the same shape on every rank, what any rank set. Collective."""
    from mpi4py import MPI

    comm.Allreduce(MPI.IN_PLACE, marks, MPI.MAX)


def part_of(comm, takes_part):
    """Return the communicator of the ranks that take part, and one of this rank alone to the others. Collective."""
    from mpi4py import MPI

    if comm.size == 1:
        return comm
    split = comm.Split(0 if takes_part else MPI.UNDEFINED, comm.rank)
    return split if takes_part else MPI.COMM_SELF


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
    count = comm.allreduce(values.size)
    largest = comm.allreduce(_largest_magnitude(values), op=_op("MAX"))
    if not math.isfinite(largest):
        return math.nan
    if largest == 0.0:
        return 0.0
    bits = 61 - max(1, math.ceil(math.log2(count + 1)))
    exponent = math.frexp(largest)[1]
    total = comm.allreduce(np.array(_integer_sums(values, bits, exponent), dtype=np.int64))
    return _scaled((int(total[0]) << bits) + int(total[1]), exponent - 2 * bits)


def compile_exact_sum():
    """Compile what exact_sum computes on each rank. Local."""
    values = np.ones(1)
    _largest_magnitude(values)
    _integer_sums(values, 60, 1)


@kernel
def _largest_magnitude(values):
    """Return max |values|, infinity when one is not finite, 0 without any."""
    largest, finite = 0.0, True
    for n in range(len(values)):
        magnitude = abs(values[n])
        finite = finite and magnitude < np.inf
        largest = max(largest, magnitude)
    return largest if finite else np.inf


@kernel
def _integer_sums(values, bits, exponent):
    """Return the sums of the values as whole multiples of 2^(exponent - bits) and of what is left of each as multiples of 2^(exponent - 2 bits)."""
    coarse_sum, fine_sum = np.int64(0), np.int64(0)
    for n in range(len(values)):
        coarse = np.rint(math.ldexp(values[n], bits - exponent))
        fine = np.rint(math.ldexp(values[n] - math.ldexp(coarse, exponent - bits), 2 * bits - exponent))
        coarse_sum += np.int64(coarse)
        fine_sum += np.int64(fine)
    return coarse_sum, fine_sum


def _scaled(integer, exponent):
    """Return integer * 2**exponent, correctly rounded, for integers wider than a float."""
    surplus = max(0, integer.bit_length() - 1000)
    return math.ldexp(float(integer >> surplus), exponent + surplus)
