"""Sums and errors over ranks."""
import numpy as np
import pytest

from pdhpc.parallel.comm import agree_on_error, exact_sum, on_root

VALUES = np.random.default_rng(0).standard_normal(999) * 10.0 ** np.random.default_rng(1).integers(-9, 9, 999)


@pytest.mark.mpi(min_size=2)
def test_exact_sum_does_not_depend_on_the_spread(comm):
    from mpi4py import MPI

    alone = exact_sum(MPI.COMM_SELF, VALUES)
    for seed in range(5):
        owner = np.random.default_rng(seed).integers(0, comm.size, len(VALUES))
        assert exact_sum(comm, VALUES[owner == comm.rank]) == alone
    assert exact_sum(comm, VALUES if comm.rank == 1 else np.empty(0)) == alone
    assert np.isnan(exact_sum(comm, np.array([np.nan]) if comm.rank == 1 else np.ones(2)))


class Awkward(Exception):
    """Cannot be unpickled: it is made of two words, and remembers one."""

    def __init__(self, one, other):
        super().__init__(f"{one} and {other}")


@pytest.mark.mpi(min_size=2)
def test_an_error_on_one_rank_is_raised_on_all(comm):
    with pytest.raises(KeyError, match="lost"):
        with agree_on_error(comm):
            if comm.rank == comm.size - 1:
                raise KeyError("lost")
    with agree_on_error(comm):
        pass
    with pytest.raises(RuntimeError if comm.rank < comm.size - 1 else Awkward, match="Awkward: 1 and 2|1 and 2") as caught:
        with agree_on_error(comm):
            if comm.rank == comm.size - 1:
                raise Awkward(1, 2)
    assert caught.value.raised_by == comm.size - 1
    with pytest.raises(ValueError, match="root"):
        on_root(comm, int, "root")
    assert on_root(comm, lambda: comm.rank) == 0
