import numpy as np
import pytest

from pdhpc.parallel.partition import Nowhere, Partition, bisect, share_out


def test_owner_and_box_of_a_hand_made_tree():
    # root cuts x at 1; left child is rank 0, right child cuts y at 5 into ranks 1 and 2
    tree = Partition(np.array([0, 1]), np.array([1.0, 5.0]), np.array([[-1, 1], [-2, -3]]), 3)
    points = np.array([[0.5, 9.0], [1.0, 4.0], [2.0, 5.0]])
    assert tree.owner(points).tolist() == [0, 1, 2]
    assert tree.box(1, 2)[0].tolist() == [1.0, -np.inf] and tree.box(1, 2)[1].tolist() == [np.inf, 5.0]


def test_one_rank_owns_everything(comm):
    tree = bisect(comm, np.random.default_rng(0).random((10, 3)), np.ones(10, int))
    assert set(tree.owner(np.random.default_rng(1).random((5, 3)))) == {0}


class Pretend:
    """A communicator of one process that says it has many ranks: the cuts only need sums."""

    rank = 0

    def __init__(self, size):
        self.size = size

    def Allreduce(self, in_place, array, op):
        pass


def test_weights_are_shared_evenly_for_any_number_of_ranks():
    random = np.random.default_rng(3)
    points, weights = random.random((20_000, 3)) * [3.0, 2.0, 1.0], random.integers(1, 100, 20_000)
    for size in (2, 3, 5, 16, 37):
        tree = bisect(Pretend(size), points, weights)
        share = np.bincount(tree.owner(points), weights=weights, minlength=size)
        assert len(share) == size
        assert share.max() / share.mean() < 1.03
        for rank in range(size):
            lower, upper = tree.box(rank, 3)
            inside = np.all((points >= lower) & (points < upper), axis=1)
            assert np.array_equal(inside, tree.owner(points) == rank)


def test_lattice_planes_stay_whole():
    x, y = np.meshgrid(np.arange(50) + 0.5, np.arange(10) + 0.5, indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    owner = bisect(Pretend(4), points, np.ones(500, int)).owner(points).reshape(50, 10)
    assert np.all(owner == owner[:, :1])


@pytest.mark.parametrize("size", (2, 3, 4, 8))
@pytest.mark.parametrize("snap", (None, lambda axis, coordinate, after: np.floor(coordinate) + after), ids=("free", "between layers"))
@pytest.mark.parametrize("where", (-7.5, 0.5, 40.5))
def test_boxes_and_owners_agree_when_ranks_go_without(size, snap, where):
    points = np.array([[where, 0.5], [where + 1.0, 0.5], [where + 1.0, 1.5]])
    tree = bisect(Pretend(size), points, np.ones(3, int), snap)
    inside = np.array([np.all((points >= lower) & (points < upper), axis=1) for lower, upper in (tree.box(rank, 2) for rank in range(size))])
    assert np.array_equal(np.argmax(inside, axis=0), tree.owner(points)) and np.all(inside.sum(axis=0) == 1), "each point lies in one box"


@pytest.mark.parametrize("size", (2, 3, 4, 5, 7))
def test_cuts_between_layers_share_as_well_as_cuts_anywhere(size):
    x, y, z = np.meshgrid(np.arange(23) + 0.5, np.arange(16) + 0.5, np.arange(15) + 0.5, indexing="ij")
    points = 0.1 * np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    weights = np.random.default_rng(2).integers(50, 123, len(points))
    free = bisect(Pretend(size), points, weights)
    snapped = bisect(Pretend(size), points, weights, lambda axis, coordinate, after: 0.1 * (np.floor(coordinate / 0.1) + after))
    assert np.array_equal(free.owner(points), snapped.owner(points)), "the same particles: only the planes differ"
    assert np.allclose(snapped.cut / 0.1, np.rint(snapped.cut / 0.1), atol=1e-9)


def test_more_ranks_than_points():
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    owner = bisect(Pretend(5), points, np.ones(2, int)).owner(points)
    assert len(set(owner)) == 2


def test_boxes_hold_shares_of_the_weight():
    points, shares = np.random.default_rng(0).random((20_000, 2)), [1.0, 0.25, 1.0]
    tree = bisect(Pretend(1), points, np.ones(20_000, int), shares=shares)
    held = np.bincount(tree.owner(points), minlength=3) / 20_000
    assert held == pytest.approx(np.array(shares) / 2.25, abs=2e-3)


@pytest.mark.parametrize("works, size", [([3.0, 1.0], 2), ([1.0, 1.0], 4), ([9.0, 1.0], 7), ([5.0, 3.0, 2.0], 3), ([1.0, 1e-6], 5), ([2.0, 3.0], 1)])
def test_work_is_shared_out_in_intervals(works, size):
    shared = share_out(works, size)
    loads = np.zeros(size)
    for work, (first, shares) in zip(works, shared):
        loads[first : first + len(shares)] += work * shares / shares.sum()
        assert len(shares) >= 1 and 0 <= first and first + len(shares) <= size and np.all(shares > 0)
    assert loads == pytest.approx(np.full(size, sum(works) / size), rel=0.03)


def test_borders_of_work_move_to_borders_of_ranks():
    assert [(first, len(shares)) for first, shares in share_out([1.01, 0.99], 2)] == [(0, 1), (1, 1)]
    assert [(first, len(shares)) for first, shares in share_out([1.2, 0.8], 2)] == [(0, 2), (1, 1)]


def test_nowhere_holds_nothing():
    lower, upper = Nowhere().box(0, 3)
    assert not (lower < upper).any() and Nowhere().owner(np.zeros((2, 3))).tolist() == [0, 0]
