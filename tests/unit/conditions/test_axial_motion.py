import numpy as np
import pytest

from pdhpc.conditions.axial_motion import AxialMotion, derivative, polynomial

POINTS = np.random.default_rng(1).uniform(-1, 1, (50, 3))
TILTED = AxialMotion((0.1, -0.2, 0.3), (1.0, 2.0, -2.0), 0.5, (3.0, 0.0, -2.0), (0.0, 4.0), (5.0, 1.0))


def test_about_the_z_axis_by_its_formula():
    """v_r = 200 - 50 (z/a)^2, v_z = 100 z/a, w = 7."""
    velocity = AxialMotion((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), 0.25, (200.0, 0.0, -50.0), (0.0, 100.0), (7.0,)).velocity(POINTS)
    x, y, z = POINTS.T
    r = np.hypot(x, y)
    radial = 200 - 50 * (z / 0.25) ** 2
    assert np.allclose(velocity, np.stack([radial * x / r - 7 * y, radial * y / r + 7 * x, 100 * z / 0.25], axis=1), rtol=1e-13)


def test_about_a_tilted_axis_it_is_the_turned_motion():
    """R carries z onto the axis: v(x) = R v_z(R^T (x - origin))."""
    axis = np.array([1.0, 2.0, -2.0]) / 3
    first = np.cross(axis, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first)
    turn = np.stack([first, np.cross(axis, first), axis], axis=1)
    upright = AxialMotion((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, TILTED.radial, TILTED.axial, TILTED.angular)
    assert np.allclose(TILTED.velocity(POINTS), upright.velocity((POINTS - TILTED.origin) @ turn) @ turn.T, rtol=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_gradients_are_differences_of_velocities(dim):
    motion = TILTED if dim == 3 else AxialMotion((0.1, -0.2), (0.0, 0.0, 1.0), 1.0, (3.0,), (), (5.0,))
    points, step = POINTS[:, :dim], 1e-6
    for axis in range(dim):
        shift = step * np.eye(dim)[axis]
        difference = (motion.velocity(points + shift) - motion.velocity(points - shift)) / (2 * step)
        assert np.allclose(motion.gradient(points)[:, :, axis], difference, rtol=1e-6, atol=1e-5)


def test_in_the_plane():
    velocity = AxialMotion((1.0, 0.0), (0.0, 0.0, 1.0), 1.0, (2.0,), (), (3.0,)).velocity(np.array([[1.0, 4.0], [-1.0, 0.0]]))
    assert np.allclose(velocity, [[-12.0, 2.0], [-2.0, -6.0]])


def test_nothing_points_outwards_on_the_axis():
    points = np.array([TILTED.origin, np.array(TILTED.origin) + (0.5, 1.0, -1.0)])
    alone = AxialMotion(TILTED.origin, TILTED.axis, 0.5, (3.0,))
    assert (alone.velocity(points) == 0).all() and (alone.gradient(points) == 0).all()
    assert np.isfinite(TILTED.gradient(points)).all()


def test_polynomials():
    assert polynomial((), np.ones(2)).tolist() == [0.0, 0.0] and derivative((5.0,)) == () and derivative((1.0, 2.0, 3.0)) == (2.0, 6.0)
    assert polynomial((1.0, 2.0, 3.0), np.array([2.0])).tolist() == [17.0]
