import numpy as np
import pytest

from pdhpc.kernels.motion import all_finite, drift, kick, place


def test_kick_uses_each_block_s_density():
    velocity, force = np.zeros((2, 2)), np.array([[1.0, 2.0], [3.0, 4.0]])
    kick(velocity, force, np.array([0.5, 0.1]), np.array([1, 0], np.uint8), 2.0)
    assert np.allclose(velocity, [[0.2, 0.4], [3.0, 4.0]])


@pytest.mark.parametrize("linear", [False, True])
def test_drift_and_place_agree(linear):
    reference, velocity = np.random.default_rng(0).random((3, 4)), np.random.default_rng(1).random((3, 3))
    displacement, position, again = np.full((3, 3), 0.25), np.zeros((3, 4)), np.zeros((3, 4))
    drift(displacement, velocity, reference, position, linear, 0.5)
    assert np.array_equal(displacement, 0.25 + 0.5 * velocity)
    assert np.array_equal(position[:, :3], displacement if linear else reference[:, :3] + displacement)
    place(reference, displacement, again, linear)
    assert np.array_equal(again, position)


def test_the_first_row_that_is_not_finite():
    field = np.zeros((5, 3))
    assert all_finite(field) == -1
    field[3, 1] = np.nan
    field[4, 0] = np.inf
    assert all_finite(field) == 3
    assert all_finite(field[4:]) == 0
