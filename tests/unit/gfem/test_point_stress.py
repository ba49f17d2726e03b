import numpy as np
import pytest

from pdhpc.gfem.point_stress import add_stress_forces, gradient_at_points, stress_2d


@pytest.fixture
def fields():
    """Three points in one cell of random functions: (corners, at_points, gradients, mean)."""
    random = np.random.default_rng(3).normal
    corners = np.array([[4, 2, 0, 1]], np.int32)
    return corners, (np.array([0, 3]), random(size=(3, 4)), random(size=(3, 2))), (random(size=(3, 4, 2)), random(size=(3, 2, 2))), random(size=(5, 2))


def test_forces_are_adjoint_to_gradients(fields):
    """sum_p sigma : grad u = -(right . nodes + tested . amplitude) for all sigma and u."""
    corners, at_points, gradients, mean = fields
    random = np.random.default_rng(4).normal
    nodes, amplitude, stress, gradient = random(size=(5, 2)), random(size=(5, 2)), random(size=(3, 2, 2)), np.empty((3, 2, 2))
    right, tested = np.zeros((5, 2)), np.zeros((5, 2))
    gradient_at_points(corners, at_points, gradients, mean, nodes, amplitude, gradient)
    add_stress_forces(corners, at_points, gradients, mean, stress, right, tested)
    assert np.sum(stress * gradient) == pytest.approx(-np.sum(right * nodes) - np.sum(tested * amplitude), rel=1e-13)


def test_gradient_is_the_derivative_of_the_product(fields):
    """d_j (N_a (nodes_a + (eta - mean_a) amplitude_a)) at one point, term by term."""
    corners, (start, shape, eta), (of_shape, of_eta), mean = fields
    nodes, amplitude, gradient = np.sin(mean), np.cos(mean), np.empty((3, 2, 2))
    gradient_at_points(corners, (start, shape, eta), (of_shape, of_eta), mean, nodes, amplitude, gradient)
    v, p, d, j = corners[0], 1, 0, 1
    expected = of_shape[p, :, j] @ (nodes[v, d] + (eta[p, d] - mean[v, d]) * amplitude[v, d]) + of_eta[p, d, j] * (shape[p] @ amplitude[v, d])
    assert gradient[p, d, j] == pytest.approx(expected, rel=1e-13)


def test_stress_by_voigt():
    """C = diag(2, 3, 5), strain (1, 10, 0.1 + 0.3), volume 7."""
    result = np.empty((1, 2, 2))
    stress_2d(np.diag([2.0, 3.0, 5.0])[None], np.array([[[1.0, 0.1], [0.3, 10.0]]]), 7.0, result)
    assert result[0] == pytest.approx(7.0 * np.array([[2.0, 2.0], [2.0, 30.0]]))
