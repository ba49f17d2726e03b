import numpy as np
import pytest

from pdhpc.conditions.time_functions import Constant
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.loads import body_loads, facets_of_set, facets_where, gravity_loads, nodal_load, outward_normals, traction_loads, vertices_of
from pdhpc.fem.nodes import Nodes, stars_of
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, solid


def top(x, n):
    return n[:, 1] > 0.99


def test_facets_are_chosen_by_place_and_normal(comm):
    mesh = box_mesh(comm, (4, 3))
    facets, cell = facets_where(mesh, lambda x, n: (n[:, 1] > 0.99) & (x[:, 0] < 0.5))
    assert len(facets) == 2 and np.allclose(mesh.points[facets][:, :, 1], 1.2) and np.allclose(outward_normals(mesh, facets), [0, 1])
    assert np.flatnonzero(vertices_of(mesh, facets)).tolist() == [3, 7, 11]


@pytest.mark.parametrize("kind, counts", (("quad", (3, 2)), ("hexahedron", (2, 3, 2)), ("tetra", (2, 2, 2))))
def test_sets_are_found_on_the_surface(comm, kind, counts):
    mesh = general_mesh(comm, kind, counts)
    facets, cell = facets_where(mesh, top)
    mesh.sets["lid"] = np.roll(facets[::-1], 1, axis=1)  # another order, other first corners
    found, where = facets_of_set(mesh, "lid")
    assert np.array_equal(found, facets) and np.array_equal(where, cell)
    with pytest.raises(ValueError, match="no set 'base'; it has lid"):
        facets_of_set(mesh, "base")


def test_a_linear_pressure_on_one_edge(comm):
    """p = x/L on an edge of length h from 0: h/6 and h/3 of the end value on its two vertices."""
    mesh = box_mesh(comm, (1, 1), (2.0, 1.0))
    loads = traction_loads(solid(mesh, thickness=3.0), *facets_where(mesh, top), lambda x, n: -n * x[:, :1] / 2.0)
    assert loads[:, 1] == pytest.approx([0.0, -3.0 * 2.0 / 6, 0.0, -3.0 * 2.0 / 3], abs=1e-13) and not loads[:, 0].any()


def test_gravity_is_the_weight(comm):
    mesh = general_mesh(comm, "triangle", (3, 3), 0.2)
    body = solid(mesh)
    weight = gravity_loads(body, stars_of(mesh), [0.0, -9.81])
    assert weight.sum(axis=0) == pytest.approx([0.0, -9.81 * 1.2]) and weight[:, 1] == pytest.approx(-9.81 * body.lumped_mass(stars_of(mesh)))
    moved = body_loads(body, stars_of(mesh), lambda x: x)
    assert moved.sum(axis=0) == pytest.approx([1.2 / 2, 1.2**2 / 2])


def test_flat_tops_are_loaded_by_their_own_functions(comm):
    """Constants carry the resultant; the slopes of a side are loaded by its tractions too, since x - x_i does not vanish there."""
    mesh = box_mesh(comm, (2, 2), (1.0, 1.0))
    body = solid(mesh, basis=FlatTop("quad"))
    loads = traction_loads(body, *facets_where(mesh, top), [0.0, 1.0]).reshape(9, 3, 2)
    assert loads[:, 0, 1].sum() == pytest.approx(1.0) and loads[[2, 5, 8], 0, 1] == pytest.approx([0.25, 0.5, 0.25])
    linear = body.basis.linear(mesh, [[0, 0], [1, 0]], [0, 0])  # u_y = x: work of the load is 1/2
    assert (loads.reshape(9, 6) * linear).sum() == pytest.approx(0.5)
    assert body_loads(body, stars_of(mesh), [0.0, 2.0]).reshape(9, 3, 2)[:, 0, 1].sum() == pytest.approx(2.0)


def test_only_loaded_vertices_are_kept(comm):
    nodes = Nodes(box_mesh(comm, (2, 1)))
    values = np.zeros((6, 2))
    values[4] = [1.0, 2.0]
    load = nodal_load(nodes, values, Constant())
    assert load.indices.tolist() == [nodes.slots[4]] and load.vector.tolist() == [[1.0, 2.0]]
