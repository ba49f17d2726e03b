import numpy as np
import pytest

from pdhpc.fem.nodes import Nodes, stars_of
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh


@pytest.mark.parametrize("counts", ((5, 3), (2, 9, 4)))
def test_a_grid_has_its_longest_axis_fastest(comm, counts):
    mesh = box_mesh(comm, counts)
    nodes = Nodes(mesh)
    assert nodes.stride[int(np.argmax(counts))] == 1 and nodes.n_slots % 8 == 0
    index = np.rint(mesh.points / mesh.cell_size).astype(int)
    for axis in range(mesh.dim):
        for v in np.flatnonzero(index[:, axis] == 0):
            neighbour = np.flatnonzero((index == index[v] + np.eye(mesh.dim, dtype=int)[axis]).all(axis=1))[0]
            assert nodes.slots[neighbour] - nodes.slots[v] == nodes.stride[axis]
    reach = int(nodes.stride.sum()) + 8  # a stencil reads that far
    assert nodes.slots.min() >= reach and nodes.slots.max() + reach <= nodes.n_slots
    assert len(np.unique(nodes.slots)) == len(mesh.points)


def test_fields_are_by_slot(comm):
    mesh = box_mesh(comm, (3, 2))
    for nodes in (Nodes(mesh), Nodes(mesh, False), Nodes(mesh, False, 6)):
        values = np.arange(12.0 * nodes.width).reshape(12, -1)
        nodes.put(nodes.velocity, values)
        assert np.array_equal(nodes.owned(nodes.velocity), values) and np.array_equal(nodes.local(nodes.velocity), values)
        assert nodes.velocity.T.flags.c_contiguous and nodes.velocity.sum() == values.sum()
        nodes.set_mass(np.ones(12))
        assert nodes.mass.sum() == 12.0 and nodes.new_field(1).shape == (nodes.n_slots, 1)
    assert Nodes(general_mesh(comm, "triangle", (2, 2))).stride is None


def test_stars_list_cells_by_ascending_id(comm):
    mesh = general_mesh(comm, "tetra", (2, 2, 2))
    start, cell, corner = stars_of(mesh)
    for v in range(mesh.n_owned):
        around = cell[start[v] : start[v + 1]]
        assert np.array_equal(mesh.cell_id[around], np.sort(mesh.cell_id[(mesh.cells == v).any(axis=1)]))
        assert (mesh.cells[around, corner[start[v] : start[v + 1]]] == v).all()
