import numpy as np
import pytest

from pdhpc.parallel.ghosts import GhostExchange


def test_one_rank_has_nothing_to_exchange(comm):
    exchange = GhostExchange(comm, np.arange(4), np.empty(0, np.int64), np.empty(0, np.int64))
    field = np.arange(8.0).reshape(4, 2)
    bound = exchange.bind(field)
    bound.refresh()
    bound.accumulate()
    assert exchange.sent == 0 and np.array_equal(field, np.arange(8.0).reshape(4, 2))


def test_a_field_of_the_wrong_length_is_refused(comm):
    exchange = GhostExchange(comm, np.arange(4), np.empty(0, np.int64), np.empty(0, np.int64))
    with pytest.raises(ValueError, match="C-contiguous"):
        exchange.bind(np.zeros((5, 2)))
