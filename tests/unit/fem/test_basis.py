import numpy as np
import pytest

from pdhpc.fem.basis import Hats, rigid_motions
from pdhpc.fem.flat_top import FlatTop
from pdhpc.study.verify.fem_problems import box_mesh, solid
from pdhpc.fem.nodes import stars_of
from pdhpc.fem.vertex_matrix import VertexMatrix


def test_hats_are_the_elements_shape_functions():
    basis = Hats("triangle")
    xi = np.array([[0.2, 0.3]])
    assert basis.functions == 1 and basis.shape(xi)[0] == pytest.approx([0.5, 0.2, 0.3]) and basis.gradient(xi)[0].tolist() == [[-1, -1], [1, 0], [0, 1]]
    assert basis.facet_quadrature()[1].sum() == pytest.approx(1.0) and basis.fine_quadrature()[1].sum() == pytest.approx(0.5)


def test_hats_hold_vertices_and_take_values(comm):
    basis, mesh = Hats("quad"), box_mesh(comm, (2, 2))
    assert basis.held_functions(np.array([[True, False], [False, False]])).tolist() == [[True], [False]]
    assert basis.interpolated(mesh, np.ones((9, 2)), np.zeros((9, 2, 2))).shape == (9, 1, 2)
    assert basis.linear(mesh, [[1, 0], [0, 2]], [0.5, 0.0]) == pytest.approx(mesh.points * [1, 2] + [0.5, 0])


@pytest.mark.parametrize("counts, number", (((3, 2), 3), ((2, 2, 3), 6)))
@pytest.mark.parametrize("kind", (Hats, FlatTop))
def test_rigid_motions_cost_nothing(comm, counts, number, kind):
    mesh = box_mesh(comm, counts)
    body = solid(mesh, basis=kind(mesh.kind))
    motions = rigid_motions(body.basis, mesh)
    assert motions.shape == (len(mesh.points), body.width, number) and np.linalg.matrix_rank(motions.reshape(-1, number)) == number
    stiffness = VertexMatrix(mesh, stars_of(mesh), body.width, (1.0, body.stiffness()))
    assert max(np.abs(stiffness.multiply(motions[..., k])).max() for k in range(number)) < 1e-13
    assert np.abs(stiffness.multiply(body.basis.linear(mesh, np.eye(mesh.dim), np.zeros(mesh.dim)))).max() > 0.01
