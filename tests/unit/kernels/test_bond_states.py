import numpy as np

from pdhpc.kernels.bond_states import count_alive, foremost_damaged
from pdhpc.kernels.neighbours import find_bonds


def test_counts_follow_the_bits():
    points = np.random.default_rng(0).random((60, 2))
    bonds, sizes = find_bonds(points, np.arange(60), 60, 0.4)
    counts = np.empty(60, np.int32)
    count_alive(bonds, counts)
    assert np.array_equal(counts, sizes)
    bonds.alive[bonds.row_start[7] >> 3] &= 0b11111100  # the first two slots of row 7
    count_alive(bonds, counts)
    assert counts[7] == sizes[7] - 2 and counts.sum() == sizes.sum() - 2


def test_foremost_of_the_damaged():
    points = np.random.default_rng(0).random((60, 2))
    bonds, sizes = find_bonds(points, np.arange(60), 60, 0.4)
    ahead, members = points[:, 0].copy(), np.arange(60)
    assert foremost_damaged(bonds, sizes, 0.1, members, ahead) == -1
    for i in (5, 9):
        bonds.alive[bonds.row_start[i] >> 3 : bonds.row_start[i + 1] >> 3] = 0
    best = 5 if ahead[5] > ahead[9] else 9
    assert foremost_damaged(bonds, sizes, 0.1, members, ahead) == best
    assert foremost_damaged(bonds, sizes, 0.1, np.array([14 - best]), ahead) == 14 - best
    assert foremost_damaged(bonds, sizes, 1.0, members, ahead) == -1
