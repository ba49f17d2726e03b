"""Refresh and accumulate on a ring of ranks that each hold a ghost of both neighbours' ends."""
import numpy as np
import pytest

from pdhpc.parallel.ghosts import GhostExchange

N = 5


def ring(comm):
    """Return (exchange, owned ids, ghost ids): rank r owns N ids from N r on, and holds as ghosts the next id after and before its own."""
    owned = np.arange(N * comm.rank, N * (comm.rank + 1))
    ghosts = np.unique([(owned[0] - 1) % (N * comm.size), (owned[-1] + 1) % (N * comm.size)])
    return GhostExchange(comm, owned, ghosts, ghosts // N), owned, ghosts


@pytest.mark.mpi(min_size=2)
def test_refresh_brings_owners_values(comm):
    exchange, owned, ghosts = ring(comm)
    ids = np.concatenate([owned, ghosts])
    for width in (1, 2, 4):
        field = np.full((len(ids), width), -1.0)
        bound = exchange.bind(field)
        for repeat in range(3):
            field[:N] = owned[:, None] + np.arange(width) / 10 + repeat
            bound.refresh()
            assert np.array_equal(field, ids[:, None] + np.arange(width) / 10 + repeat)
        bound.free()
    assert exchange.sent == 2


@pytest.mark.mpi(min_size=2)
def test_accumulate_adds_ghosts_to_their_owners(comm):
    exchange, owned, ghosts = ring(comm)
    field = np.ones((N + len(ghosts), 2))
    field[N:] = 10.0
    exchange.bind(field).accumulate()
    expected = np.ones((N, 2))
    expected[[0, -1]] += 10.0
    assert np.array_equal(field[:N], expected)


@pytest.mark.mpi(min_size=2)
def test_a_rank_with_nothing_takes_part(comm):
    owned = np.arange(4) if comm.rank == 0 else np.empty(0, np.int64)
    ghosts = np.array([1, 3]) if comm.rank == 1 else np.empty(0, np.int64)
    exchange = GhostExchange(comm, owned, ghosts, np.zeros(len(ghosts), np.int64))
    field = np.zeros((len(owned) + len(ghosts), 2))
    field[: len(owned)] = owned[:, None]
    exchange.bind(field).refresh()
    assert comm.rank != 1 or field[:, 0].tolist() == [1.0, 3.0]
