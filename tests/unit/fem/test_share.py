import numpy as np

from pdhpc.fem.share import order_owned_first


def test_own_first_then_ghosts_by_owner_and_id():
    owner, ids = np.array([0, 1, 2, 1, 0, 1]), np.array([5, 9, 1, 3, 4, 7])
    order, n_owned = order_owned_first(owner, ids, 1)
    assert n_owned == 3
    assert list(zip(owner[order], ids[order])) == [(1, 3), (1, 7), (1, 9), (0, 4), (0, 5), (2, 1)]


def test_nothing_at_all():
    order, n_owned = order_owned_first(np.empty(0, int), np.empty(0, int), 0)
    assert len(order) == 0 and n_owned == 0
