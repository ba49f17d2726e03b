"""Refresh and accumulate on a ring of ranks that each hold a ghost of both neighbours' ends, in slots in order or scattered."""
import numpy as np
import pytest

from pdhpc.parallel.ghosts import GhostExchange

N, N_SLOTS = 5, 23


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
        assert bound_bytes(exchange, field) == 8 * width * 2
    assert exchange.sent == 2


def bound_bytes(exchange, field):
    """Bytes that this rank sends per refresh of a field."""
    bound = exchange.bind(field)
    sent = bound.bytes_sent
    bound.free()
    return sent


def scattered(comm, seed=0):
    """Return (exchange, number of slots, slots of the owned, their ids, slots of the ghosts, their ids): everything anywhere among N_SLOTS slots."""
    owned = np.arange(N * comm.rank, N * (comm.rank + 1))
    ghosts = np.unique([(owned[0] - 1) % (N * comm.size), (owned[-1] + 1) % (N * comm.size)])
    slots = np.random.default_rng(10 * comm.rank + seed).permutation(N_SLOTS)[: N + len(ghosts)].astype(np.int32)
    order = np.lexsort((ghosts, ghosts // N))
    ghosts = ghosts[order]
    return GhostExchange(comm, owned, ghosts, ghosts // N, slots[:N], slots[N:]), slots[:N], owned, slots[N:], ghosts


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("layout", ("rows", "columns", "part of a row"))
def test_refresh_between_scattered_slots(comm, layout):
    """Owned particles and ghosts may lie anywhere in fields of any strides; what is neither is left alone."""
    exchange, slots, owned, ghost_slots, ghosts = scattered(comm)
    whole = np.full((N_SLOTS, 4), -1.0)
    field = {"rows": np.full((N_SLOTS, 3), -1.0), "columns": np.full((3, N_SLOTS), -1.0).T, "part of a row": whole[:, :3]}[layout]
    bound = exchange.bind(field)
    for repeat in range(3):
        field[slots] = owned[:, None] + np.arange(3) / 10 + repeat
        bound.start_refresh()
        field[slots] += 0.0  # owned values may be read while messages travel
        bound.finish_refresh()
        assert np.array_equal(field[ghost_slots], ghosts[:, None] + np.arange(3) / 10 + repeat)
        assert np.array_equal(field[slots], owned[:, None] + np.arange(3) / 10 + repeat)
    others = np.setdiff1d(np.arange(N_SLOTS), np.concatenate([slots, ghost_slots]))
    assert np.all(field[others] == -1.0) and np.all(whole[:, 3] == -1.0)
    assert bound.bytes_sent == 8 * 3 * exchange.sent == 8 * 3 * 2
    bound.free()


@pytest.mark.mpi(min_size=2)
def test_accumulate_between_scattered_slots(comm):
    exchange, slots, owned, ghost_slots, ghosts = scattered(comm, 1)
    field = np.zeros((2, N_SLOTS)).T
    field[slots], field[ghost_slots] = 1.0, 10.0
    bound = exchange.bind(field)
    bound.accumulate()
    expected = np.ones((N, 2))
    expected[[0, -1]] += 10.0
    assert np.array_equal(field[slots], expected) and np.all(field[ghost_slots] == 10.0)
    bound.free()


@pytest.mark.mpi(min_size=2)
def test_two_fields_can_travel_at_once(comm):
    """Messages between two ranks keep their order: those of two fields bound to one exchange do not cross."""
    exchange, slots, owned, ghost_slots, ghosts = scattered(comm, 2)
    fields = [np.zeros((N_SLOTS, 2)), np.zeros(N_SLOTS)]
    bounds = [exchange.bind(field) for field in fields]
    fields[0][slots], fields[1][slots] = owned[:, None], -owned
    for bound in bounds:
        bound.start_refresh()
    for bound in bounds:
        bound.finish_refresh()
    assert np.array_equal(fields[0][ghost_slots], np.stack([ghosts, ghosts], axis=1)) and np.array_equal(fields[1][ghost_slots], -ghosts)


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


@pytest.mark.mpi(min_size=2)
def test_a_restricted_exchange_moves_what_is_marked(comm):
    """Even ids only: odd ghosts keep what they have, and odd owners gain nothing."""
    exchange, owned, ghosts = ring(comm)
    ids = np.concatenate([owned, ghosts])
    field = np.full((len(ids), 2), -1.0)
    field[:N] = owned[:, None]
    bound = exchange.restricted(ids % 2 == 0).bind(field)
    bound.refresh()
    assert np.array_equal(field[N:, 0], np.where(ghosts % 2 == 0, ghosts, -1))
    field[:N], field[N:] = 0.0, 1.0
    bound.accumulate()
    held = sum(np.bincount(each, minlength=N * comm.size) for each in comm.allgather(ghosts))
    assert np.array_equal(field[:N, 1], np.where(owned % 2 == 0, held[owned], 0))
    bound.free()
