import numpy as np
import pytest

from pdhpc.fem.facets import DIM, UNIT_CORNERS
from pdhpc.fem.locate import find_cells
from pdhpc.fem.mesh import Mesh, cell_partition, make_box_mesh
from pdhpc.fem.share import Share


def bilinear(kind, place):
    """Values (n, corners) of the shape functions at (n, dim), straight from their definition."""
    corners = UNIT_CORNERS[kind]
    if kind in ("triangle", "tetra"):
        return np.column_stack([1.0 - place.sum(axis=1), place])
    return np.prod(np.where(corners[None] == 1, place[:, None], 1.0 - place[:, None]), axis=2)


def one_cell(kind, points, comm):
    none = np.empty(0, np.int64)
    number = np.arange(len(points))
    return Mesh(comm, Share(kind, number[None].astype(np.int32), np.array([0]), none, points, number, none))


@pytest.mark.parametrize("kind", sorted(DIM))
def test_points_of_a_distorted_cell_are_found_where_they_are(kind, comm):
    random = np.random.default_rng(1)
    corners = UNIT_CORNERS[kind] * 2.0 + random.uniform(-0.25, 0.25, UNIT_CORNERS[kind].shape) + 100.0
    place = random.random((200, DIM[kind]))
    if kind in ("triangle", "tetra"):
        place = place[place.sum(axis=1) < 1.0]
    points = bilinear(kind, place) @ corners
    cell, reference = find_cells(one_cell(kind, corners, comm), points)
    assert np.all(cell == 0) and np.abs(reference - place).max() < 1e-11
    outside = bilinear(kind, np.vstack([place + np.eye(DIM[kind])[0], place - 1.01])) @ corners
    cell, reference = find_cells(one_cell(kind, corners, comm), outside)
    assert np.all(cell == -1) and np.all(reference == 0.0)


def test_points_between_cells_belong_to_the_smallest_id(comm):
    """Of 4 x 3 unit cells, (1, 1) touches cells 0, 1, 3, 4; (2, 1.5) touches 4 and 7; the corner (4, 3) is in cell 11 alone."""
    mesh = make_box_mesh(comm, [0.0, 0.0], [4.0, 3.0], (4, 3), cell_partition(comm, [0.0, 0.0], [4.0, 3.0], (4, 3)))
    cell, reference = find_cells(mesh, [[1.0, 1.0], [2.0, 1.5], [4.0, 3.0], [0.0, 0.0], [-0.1, 0.0], [3.25, 0.5]])
    assert cell.tolist() == [0, 4, 11, 0, -1, 9]
    assert reference == pytest.approx(np.array([[1, 1], [1, 0.5], [1, 1], [0, 0], [0, 0], [0.25, 0.5]]), abs=1e-12)


def test_no_points(comm):
    mesh = make_box_mesh(comm, [0.0, 0.0], [1.0, 1.0], (2, 2), cell_partition(comm, [0.0, 0.0], [1.0, 1.0], (2, 2)))
    cell, reference = find_cells(mesh, np.empty((0, 2)))
    assert len(cell) == 0 and reference.shape == (0, 2)
