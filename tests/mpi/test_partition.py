"""Bisection of points that are spread over ranks."""
import numpy as np
import pytest

from pdhpc.parallel.partition import bisect


@pytest.mark.mpi(min_size=2)
def test_cuts_do_not_depend_on_the_spread_and_share_the_weight(comm):
    random = np.random.default_rng(0)
    points, weights = random.random((5000, 2)) * [2.0, 1.0], random.integers(1, 50, 5000)
    trees = []
    for seed in range(3):
        mine = np.random.default_rng(seed).integers(0, comm.size, 5000) == comm.rank
        trees.append(bisect(comm, points[mine], weights[mine]))
    assert all(np.array_equal(a, b) for tree in trees for a, b in zip(tree[:3], trees[0][:3]))
    share = np.bincount(trees[0].owner(points), weights=weights, minlength=comm.size)
    assert len(share) == comm.size and share.max() / share.mean() < 1.03


@pytest.mark.mpi(min_size=2)
def test_all_points_on_one_rank_and_on_none(comm):
    points = np.random.default_rng(0).random((100, 3)) if comm.rank == 1 else np.empty((0, 3))
    owners = bisect(comm, points, np.ones(len(points), int)).owner(points)
    assert comm.rank != 1 or set(owners) == set(range(comm.size))
    assert bisect(comm, np.empty((0, 3)), np.empty(0, int)).owner(np.empty((0, 3))).size == 0
