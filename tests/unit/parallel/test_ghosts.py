import numpy as np
import pytest

from pdhpc.parallel.ghosts import GhostExchange, compile_messages


def test_one_rank_has_nothing_to_exchange(comm):
    exchange = GhostExchange(comm, np.arange(4), np.empty(0, np.int64), np.empty(0, np.int64))
    field = np.arange(8.0).reshape(4, 2)
    bound = exchange.bind(field)
    bound.refresh()
    bound.accumulate()
    assert exchange.sent == 0 and np.array_equal(field, np.arange(8.0).reshape(4, 2))


def test_a_field_that_is_too_short_is_refused(comm):
    exchange = GhostExchange(comm, np.arange(4), np.empty(0, np.int64), np.empty(0, np.int64))
    with pytest.raises(ValueError, match="4 are needed, 3 given"):
        exchange.bind(np.zeros((3, 2)))
    scattered = GhostExchange(comm, np.arange(2), np.empty(0, np.int64), np.empty(0, np.int64), np.array([7, 2], np.int32))
    with pytest.raises(ValueError, match="8 are needed, 7 given"):
        scattered.bind(np.zeros(7))
    assert scattered.bind(np.zeros(8)).bytes_sent == 0


def test_a_restricted_exchange_keeps_what_is_marked(comm):
    """Messages to and from pretended ranks 1 and 2: slots that are not marked drop out, and ranks that are left with none."""
    exchange = GhostExchange(comm, np.arange(6), np.empty(0, np.int64), np.empty(0, np.int64))
    exchange.targets = [(1, np.array([0, 3], np.int32)), (2, np.array([1, 3, 5], np.int32))]
    exchange.sources = [(1, np.array([7, 6], np.int32)), (2, np.array([8], np.int32))]
    keep = np.isin(np.arange(9), (1, 5, 6, 7))
    few = exchange.restricted(keep)
    assert [(rank, slots.tolist()) for rank, slots in few.targets] == [(2, [1, 5])] and few.sent == 2
    assert [(rank, slots.tolist()) for rank, slots in few.sources] == [(1, [7, 6])]
    assert exchange.sent == 5 and len(exchange.sources) == 2, "the exchange itself is as before"


def test_compiling_messages_changes_nothing():
    field = np.ones((2, 3))
    compile_messages(field, np.ones((2, 1), np.uint64))
    assert np.all(field == 1.0)
