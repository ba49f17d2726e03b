import numpy as np
import pytest

from pdhpc.fem.flat_top import FlatTop
from pdhpc.study.verify.fem_problems import box_mesh


@pytest.mark.parametrize("kind", ("quad", "hexahedron"))
def test_phi_is_a_partition_of_unity_with_flat_tops(kind):
    basis = FlatTop(kind, 0.2)
    xi = np.random.default_rng(0).random((50, basis.element.dim))
    phi = basis.shape(xi).reshape(50, basis.element.corners, basis.functions)[:, :, 0]
    assert np.allclose(phi.sum(axis=1), 1.0, atol=1e-14) and phi.min() >= 0.0
    near = 0.19 * np.random.default_rng(1).random((20, basis.element.dim))
    assert np.allclose(basis.shape(near).reshape(20, basis.element.corners, -1)[:, 0, 0], 1.0)
    middle = basis.shape(np.full((1, basis.element.dim), 0.35)).reshape(basis.element.corners, -1)[0, 0]
    assert middle == pytest.approx(((1 - 0.2 - 0.35) / 0.6) ** basis.element.dim)


@pytest.mark.parametrize("kind", ("quad", "hexahedron"))
def test_gradients_are_differences(kind):
    basis, h = FlatTop(kind), 1e-6
    xi = 0.3 + 0.4 * np.random.default_rng(0).random((20, basis.element.dim))
    for axis, step in enumerate(h * np.eye(basis.element.dim)):
        assert np.allclose((basis.shape(xi + step) - basis.shape(xi - step)) / (2 * h), basis.gradient(xi)[:, :, axis], atol=1e-8)


def test_quadrature_resolves_the_ramps():
    """Products of gradients, degree 4 by axis on each piece: the same with more points; a rule that does not see the kinks is wrong."""
    basis = FlatTop("quad")

    def gram(points, weights):
        gradient = basis.gradient(points)
        return np.einsum("q,qid,qjd->ij", weights, gradient, gradient)

    exact = gram(*basis._pieces(2, 6))
    assert np.allclose(gram(*basis.quadrature), exact, atol=1e-13)
    assert np.abs(gram(*basis.element.quadrature(3)) - exact).max() > 0.05
    assert basis.quadrature[1].sum() == pytest.approx(1.0) and basis.facet_quadrature()[1].sum() == pytest.approx(1.0)


def test_linear_functions_are_held(comm):
    mesh = box_mesh(comm, (2, 3))
    basis, gradient, shift = FlatTop("quad"), np.array([[0.1, 0.2], [0.3, 0.4]]), np.array([1.0, 2.0])
    unknowns = basis.linear(mesh, gradient, shift)
    xi = np.random.default_rng(0).random((5, 2))
    for cell in mesh.cells:
        x = mesh.points[cell[0]] + xi * mesh.cell_size
        u = np.einsum("qk,ka->qa", basis.shape(xi), unknowns[cell].reshape(-1, 2))
        assert np.allclose(u, x @ gradient.T + shift)
    again = basis.interpolated(mesh, mesh.points @ gradient.T + shift, np.tile(gradient, (12, 1, 1)))
    assert np.allclose(again.reshape(12, 6), unknowns)


def test_other_cells_and_no_flat_part_are_refused():
    with pytest.raises(ValueError, match="kind tetra"):
        FlatTop("tetra")
    for flat in (0.0, 0.5):
        with pytest.raises(ValueError, match="flat part"):
            FlatTop("quad", flat)
