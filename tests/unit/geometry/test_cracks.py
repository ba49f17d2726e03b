"""The pieces that cracks are made of; kernels/test_bond_states.py cuts bonds with them."""
import numpy as np
import pytest

from pdhpc.geometry.cracks import disk, polyline, rectangle


def test_a_polyline_has_a_piece_for_each_segment():
    first, second = polyline([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0]])
    assert first.origin.tolist() == [0.0, 0.0] and second.origin.tolist() == [4.0, 0.0]
    assert first.normal.tolist() == [0.0, 1.0] and second.normal.tolist() == [-1.0, 0.0]
    assert first.along @ [4.0, 0.0] == second.along @ [0.0, 2.0] == 1.0, "the end of a segment has the coordinate 1"
    assert first.radius == second.radius == 0.0


def test_coordinates_on_a_skew_parallelogram():
    edges = np.array([[3.0, 0.0, 1.0], [1.0, 2.0, 0.0]])
    (piece,) = rectangle([1.0, 1.0, 1.0], *edges)
    assert piece.along @ edges.T == pytest.approx(np.eye(2), abs=1e-15)
    assert piece.along @ piece.normal == pytest.approx([0.0, 0.0], abs=1e-15)
    assert edges @ piece.normal == pytest.approx([0.0, 0.0], abs=1e-15) and np.linalg.norm(piece.normal) == pytest.approx(1.0)


def test_a_disk_keeps_its_radius_and_direction():
    (piece,) = disk([1.0, 2.0, 3.0], [0.0, 0.0, 5.0], 2)
    assert piece.normal.tolist() == [0.0, 0.0, 1.0] and piece.radius == 2.0 and isinstance(piece.radius, float)
    assert piece.origin.tolist() == [1.0, 2.0, 3.0]
