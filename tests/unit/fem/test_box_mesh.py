from itertools import product

import numpy as np
import pytest

from pdhpc.fem.box_mesh import Box, cell_partition, take_box_share
from pdhpc.fem.facets import UNIT_CORNERS
from pdhpc.parallel.partition import Partition

LOWER, UPPER = [0.0, 1.0, -1.0], [2.0, 1.5, 0.5]


def cross_shaped(size):
    """Four boxes around (0.8, 1.2): cut at x = 0.8, then at y = 1.2 on both sides; one or two boxes for fewer ranks."""
    if size == 1:
        return Partition(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), 1)
    if size == 2:
        return Partition(np.array([0]), np.array([0.8]), np.array([[-1, -2]]), 2)
    return Partition(np.array([0, 1, 1]), np.array([0.8, 1.2, 1.2]), np.array([[1, 2], [-1, -2], [-3, -4]]), 4)


def by_definition(box, partition, rank, keep):
    """Return what a Share says, worked out cell by cell over the whole box: {cell id: owner}, {vertex id: owner} of the share, {cell id: vertex ids}."""
    dim, vertex_shape = len(box.counts), tuple(box.counts + 1)
    owner, corners = {}, {}
    for number, index in enumerate(product(*[range(n) for n in box.counts])):
        centre = np.array([[box.centres(axis)[index[axis]] for axis in range(dim)]])
        if keep is None or keep(centre)[0]:
            owner[number] = int(partition.owner(centre)[0])
            corners[number] = [int(np.ravel_multi_index(np.add(index, corner), vertex_shape)) for corner in UNIT_CORNERS["quad" if dim == 2 else "hexahedron"]]
    vertex_owner = {}
    for number in sorted(owner, reverse=True):
        vertex_owner.update((vertex, owner[number]) for vertex in corners[number])
    mine = {vertex for number in owner if owner[number] == rank for vertex in corners[number]}
    share = {number: owner[number] for number in owner if mine & set(corners[number])}
    vertices = {vertex: vertex_owner[vertex] for number in share for vertex in corners[number]}
    return share, vertices, {number: corners[number] for number in share}


KEEPS = {
    "all": None,
    "hole": lambda centres: ((centres[:, :2] - [0.9, 1.2]) ** 2).sum(axis=1) > 0.04,
    "checkerboard": lambda centres: np.rint(centres * 40).astype(int).sum(axis=1) % 3 > 0,
    "right": lambda centres: centres[:, 0] > 1.0,
}


@pytest.mark.parametrize("keep", sorted(KEEPS))
@pytest.mark.parametrize("size", [1, 2, 4])
@pytest.mark.parametrize("counts", [(10, 5), (5, 5, 3)], ids=["quads", "hexahedra"])
def test_share_is_what_the_definition_says(counts, size, keep):
    dim = len(counts)
    box, partition = Box.of(LOWER[:dim], UPPER[:dim], counts), cross_shaped(size)
    for rank in range(size):
        cells, vertices, corners = by_definition(box, partition, rank, KEEPS[keep])
        share = take_box_share(box, partition, rank, KEEPS[keep])
        n_cells, n_points = len(share.cells) - len(share.cell_owner), len(share.points) - len(share.vertex_owner)
        ordered = [number for number in sorted(cells) if cells[number] == rank]
        assert share.cell_id[:n_cells].tolist() == ordered
        ghosts = sorted((owner, number) for number, owner in cells.items() if owner != rank)
        assert list(zip(share.cell_owner.tolist(), share.cell_id[n_cells:].tolist())) == ghosts
        assert share.vertex_id[:n_points].tolist() == [vertex for vertex in sorted(vertices) if vertices[vertex] == rank]
        ghosts = sorted((owner, vertex) for vertex, owner in vertices.items() if owner != rank)
        assert list(zip(share.vertex_owner.tolist(), share.vertex_id[n_points:].tolist())) == ghosts
        assert share.vertex_id[share.cells].tolist() == [corners[number] for number in share.cell_id]
        place = np.unravel_index(share.vertex_id, tuple(box.counts + 1))
        expected = np.stack([box.planes(axis)[place[axis]] for axis in range(dim)], axis=1) if len(share.points) else np.empty((0, dim))
        assert np.array_equal(share.points, expected)
        assert share.cells.dtype == np.int32 and share.cell_id.dtype == share.vertex_id.dtype == np.int64


def test_box_numbers():
    box = Box.of(LOWER, UPPER, (4, 1, 3))
    assert box.cell_size == pytest.approx([0.5, 0.5, 0.5])
    assert box.planes(0).tolist() == [0.0, 0.5, 1.0, 1.5, 2.0] and box.centres(2) == pytest.approx([-0.75, -0.25, 0.25])
    assert box.layer_side(0, 0.7, False) == 0.5 and box.layer_side(0, 0.7, True) == 1.0


@pytest.mark.parametrize(
    "numbers, message",
    [
        (([0.0], [1.0], [3]), "2 or 3 numbers"),
        (([0.0, 0.0], [1.0, 1.0], [3, 3, 3]), "2 or 3 numbers"),
        (([0.0, 0.0], [1.0, 0.0], [3, 3]), "upper corner above"),
        (([0.0, 0.0], [1.0, np.nan], [3, 3]), "upper corner above"),
        (([0.0, 0.0], [1.0, 1.0], [3, 0]), "at least one cell"),
    ],
)
def test_a_box_that_is_none_is_refused(numbers, message):
    with pytest.raises(ValueError, match=message):
        Box.of(*numbers)


def test_partition_of_one_rank_has_no_cut(comm):
    partition = cell_partition(comm, [0.0, 0.0], [1.0, 1.0], (3, 4), None)
    assert partition.size == 1 and partition.owner(np.zeros((2, 2))).tolist() == [0, 0]
