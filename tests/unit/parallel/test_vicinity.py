import numpy as np

from pdhpc.parallel.vicinity import Vicinity


def test_one_rank_has_no_others(comm):
    vicinity = Vicinity(comm)
    rows, owners = vicinity.gather_near(np.arange(12.0).reshape(4, 3), 2, 5.0)
    assert rows.shape == (0, 3) and len(owners) == 0
    assert vicinity.agree(np.array([1.0, -2.0])).tolist() == [1.0, -2.0]
    exchange = vicinity.exchange(np.arange(4), np.empty(0, np.int64), np.empty(0, np.int64))
    assert exchange.sources == exchange.targets == []
