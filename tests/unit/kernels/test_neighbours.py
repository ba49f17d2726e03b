import numpy as np
import pytest
from scipy.spatial import cKDTree

from pdhpc.kernels.neighbours import count_neighbours, find_bonds, mark_used, renumber


def rows(bonds, n):
    """Return the neighbours of each particle as lists, without padding, by the alive bits."""
    found = []
    for i in range(n):
        slots = range(bonds.row_start[i], bonds.row_start[i + 1])
        found.append([int(bonds.neighbour[k]) for k in slots if bonds.alive[k >> 3] >> (k & 7) & 1])
    return found


@pytest.mark.parametrize("dim", [2, 3])
def test_same_neighbours_as_a_tree(dim):
    random = np.random.default_rng(dim)
    points, radius = random.random((700, dim)), 0.17
    ids = random.permutation(700).astype(np.int64)
    bonds, counts = find_bonds(points, ids, 500, radius)
    expected = cKDTree(points).query_ball_point(points, radius)
    for i, row in enumerate(rows(bonds, 500)):
        assert set(row) == set(expected[i]) - {i}
        assert np.all(np.diff(ids[row]) > 0), "rows are sorted by global id"
        k = bonds.row_start[i] + np.arange(len(row))
        assert np.allclose(bonds.inv_length[k], 1 / np.linalg.norm(points[row] - points[i], axis=1), rtol=1e-14)
    assert counts.tolist() == [len(row) for row in rows(bonds, 500)] == count_neighbours(points, 500, radius).tolist()


def test_rows_are_padded_to_eight_with_valid_dead_slots():
    points = np.random.default_rng(0).random((50, 2))
    bonds, counts = find_bonds(points, np.arange(50), 50, 0.3)
    assert np.all(bonds.row_start % 8 == 0)
    assert bonds.neighbour.min() >= 0 and bonds.neighbour.max() < 50 and np.all(np.isfinite(bonds.inv_length))
    assert sum(bin(byte).count("1") for byte in bonds.alive) == counts.sum()


def test_sparse_and_empty_clouds():
    far = np.array([[0.0, 0.0], [1e9, 1e9]])
    bonds, counts = find_bonds(far, np.arange(2), 2, 1.0)
    assert counts.tolist() == [0, 0] and len(bonds.neighbour) == 0
    assert find_bonds(np.empty((0, 3)), np.empty(0, np.int64), 0, 1.0)[1].size == 0


def test_marking_and_renumbering():
    neighbour = np.array([4, 2, 2], np.int32)
    assert mark_used(neighbour, 6).tolist() == [False, False, True, False, True, False]
    renumber(neighbour, np.array([9, 9, 0, 9, 1, 9], np.int32))
    assert neighbour.tolist() == [1, 0, 0]


@pytest.mark.parametrize("dim", [2, 3])
def test_radii_by_pairs_of_groups(dim):
    random = np.random.default_rng(dim)
    points, group = random.random((400, dim)), random.integers(0, 3, 400)
    radius = np.array([[0.1, 0.15, 0.0], [0.15, 0.2, 0.05], [0.0, 0.05, 0.12]])
    bonds, counts = find_bonds(points, np.arange(400), 300, radius, group)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = distance <= radius[group[:, None], group[None]]
    for i, row in enumerate(rows(bonds, 300)):
        assert row == [j for j in np.flatnonzero(near[i]) if j != i]
    assert counts.tolist() == count_neighbours(points, 300, radius, group).tolist() and counts.max() > 3


def test_groups_without_bonds_still_see_each_other_at_the_same_place():
    points, radius = np.array([[0.0, 0.0], [0.0, 0.0], [0.1, 0.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])
    bonds, counts = find_bonds(points, np.arange(3), 3, radius, np.array([0, 1, 1]))
    assert counts.tolist() == [1, 2, 1] and np.isinf(bonds.inv_length[0])
