"""Communicators, errors that every rank agrees on, and sums that do not depend on the number of ranks."""
import contextlib
import math
import pickle
import sys
import time
import traceback

import numpy as np

from pdhpc.jit import kernel

_TURN, _TURNS = 0.5, 5.0  # s, between two ranks that failed, and for all of them


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
        await_turn(comm, error)
        sys.stderr.write(f"rank {comm.rank} of {comm.size}:\n{''.join(traceback.format_exception(kind, error, trace))}")
        sys.stderr.flush()
        comm.Abort(1)

    abort.aborts_mpi = True
    sys.excepthook = abort


def await_turn(comm, error):
    """Wait until this rank may speak of an error that it did not expect. Local.

    The first rank that speaks ends the job, so that of many ranks with the same error one is heard: that on which it was raised, where ranks agreed on it,
    else the lowest.
    """
    if getattr(error, "had_turn", False):
        return
    error.had_turn, first = True, getattr(error, "raised_by", None)
    if first is None:
        time.sleep(min(_TURN * comm.rank, _TURNS * comm.rank / comm.size))
    elif first != comm.rank:
        time.sleep(_TURNS)


def _portable(comm, error):
    """Return an error of this rank as other ranks can have it: it remembers who raised it, by its rank in the whole job."""
    from mpi4py import MPI

    if comm.size == 1:
        return error
    error.raised_by = MPI.COMM_WORLD.rank
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        other = RuntimeError(f"{type(error).__name__}: {error}")
        other.raised_by = error.raised_by
        return other
    return error


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
    agreed = comm.bcast(None if error is None else _portable(comm, error), root=failing)
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
    outcome, told = comm.bcast((outcome, None if failure is None else _portable(comm, failure)), root=0)
    if told is not None:
        raise failure or told
    return outcome


def smallest(comm, value):
    """Return the smallest of the ranks' values. Collective."""
    return comm.allreduce(value, op=_op("MIN"))


def largest(comm, value):
    """Return the largest of the ranks' values. Collective."""
    return comm.allreduce(value, op=_op("MAX"))


def most_of_each(comm, numbers):
    """Return [the largest of the ranks' values] of each of some whole numbers. Collective, one message."""
    from mpi4py import MPI

    most = np.array(numbers, np.int64)
    comm.Allreduce(MPI.IN_PLACE, most, MPI.MAX)
    return most.tolist()


def total_of_nodes(comm, amount):
    """Return the sum over machines of what amount() says on each of them. Collective."""
    from mpi4py import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    mine = amount() if node.rank == 0 else 0
    node.Free()
    return comm.allreduce(mine)


def join_marks(comm, marks):
    """Set in `marks`, a uint8 array of the same shape on every rank, what any rank set. Collective."""
    from mpi4py import MPI

    comm.Allreduce(MPI.IN_PLACE, marks, MPI.MAX)


class Sums:
    """Sums over the ranks of a communicator whose bits do not depend on their number, for those who know no communicator."""

    def __init__(self, comm):
        self._comm = comm

    def of(self, values):
        """Return [exact sum of each row] of values (k, n). Collective."""
        return exact_sums(self._comm, values)

    def count(self, number):
        """Return the sum of whole numbers. Collective."""
        return int(self._comm.allreduce(int(number)))

    def largest(self, value):
        """Return the largest of the ranks' values. Collective."""
        return largest(self._comm, value)


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
    return exact_sums(comm, np.ascontiguousarray(values, dtype=float).reshape(1, -1))[0]


def exact_sums(comm, values):
    """Return [exact_sum of each row] of values (k, n), k on every rank the same, with three reductions for all. Collective."""
    count, number = comm.allreduce(values.shape[1]), len(values)
    largest, totals = np.array([_largest_magnitude(row) for row in values]), np.empty((number, 2), np.int64)
    comm.Allreduce(_op("IN_PLACE"), largest, op=_op("MAX"))
    bits = 61 - max(1, math.ceil(math.log2(count + 1)))
    exponents = [math.frexp(each)[1] if math.isfinite(each) else 0 for each in largest]
    parts = [_integer_sums(row, bits, exponent) if 0.0 < each < math.inf else (0, 0) for row, exponent, each in zip(values, exponents, largest)]
    comm.Allreduce(np.array(parts, dtype=np.int64).reshape(number, 2), totals, op=_op("SUM"))
    sums = [_scaled((int(coarse) << bits) + int(fine), exponent - 2 * bits) for (coarse, fine), exponent in zip(totals, exponents)]
    return [total if math.isfinite(each) else math.nan for total, each in zip(sums, largest)]


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
