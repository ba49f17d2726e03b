import numpy as np

from pdhpc.geometry.faces import count_face
from pdhpc.kernels.neighbours import find_bonds


def test_faces_of_a_block_and_of_part_of_it():
    axes = np.meshgrid(np.arange(6.0), np.arange(4.0), np.arange(3.0), indexing="ij")
    points = np.stack([axis.ravel() for axis in axes], axis=1)
    bonds, _ = find_bonds(points, np.arange(72), 72, 2.0)
    for axis, area in ((0, 12), (1, 18), (2, 24)):
        for step in (1.0, -1.0):
            assert count_face(bonds.row_start, bonds.neighbour, points, np.ones(72, bool), axis, step) == area
    layer = points[:, 1] > 2.5
    assert count_face(bonds.row_start, bonds.neighbour, points, layer, 1, 1.0) == 18
    assert count_face(bonds.row_start, bonds.neighbour, points, layer, 0, 1.0) == 3
