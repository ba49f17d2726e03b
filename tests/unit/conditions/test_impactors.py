import numpy as np
import pytest

from pdhpc.conditions.impactors import SPHERE, Impactor
from pdhpc.conditions.time_functions import Constant, Ramp

BALL = SPHERE, np.zeros(3), 0.5, np.inf


def test_a_prescribed_impactor_follows_its_time_function():
    ball = Impactor("ball", BALL, [1.0, 2.0], [3.0, -1.0], Ramp(0.0, 1.0))
    assert not ball.free and ball.kinetic_energy == 0.0 and not ball.velocity.any()
    for _ in range(200):
        ball.move(0.01)
        ball.settle(0.01)
    # int of the ramp over 2 s is 0.5 + 1; the midpoint rule is exact on its pieces
    assert ball.position == pytest.approx([1.0 + 4.5, 2.0 - 1.5], abs=1e-12) and ball.velocity.tolist() == [3.0, -1.0]
    assert ball.time == pytest.approx(2.0)


def test_a_free_impactor_falls_as_a_parabola():
    ball = Impactor("ball", BALL, [0.0, 10.0], [1.0, 0.0], Constant(), 2.0, [0.0, -9.81])
    start = ball.kinetic_energy
    for _ in range(100):
        ball.move(0.01)
        ball.settle(0.01)
    assert ball.position == pytest.approx([1.0, 10.0 - 0.5 * 9.81], abs=1e-12) and ball.velocity == pytest.approx([1.0, -9.81], abs=1e-12)
    assert ball.kinetic_energy - start == pytest.approx(ball.gravity_work, rel=1e-12) and ball.gravity_work == pytest.approx(0.5 * 2.0 * 9.81**2)


def test_a_force_accelerates_it_by_its_mass():
    ball = Impactor("ball", BALL, [0.0, 0.0], [0.0, 0.0], Constant(), 4.0)
    ball.force[:] = [2.0, 0.0]
    ball.move(0.1)
    assert ball.velocity[0] == pytest.approx(0.025)
    ball.settle(0.1)
    assert ball.velocity[0] == pytest.approx(0.05) and ball.travelled[0] == pytest.approx(0.0025)


def test_state_goes_over_to_another():
    one, other = (Impactor("ball", BALL, [0.0, 0.0], [1.0, 0.5], Constant(), 4.0, [0.0, 1.0]) for _ in range(2))
    one.force[:] = [0.3, 0.4]
    one.move(0.1)
    for (getter, *_), (_, setter, *_) in zip(one.state().values(), other.state().values()):
        setter(getter())
    assert np.array_equal(one.position, other.position) and np.array_equal(one.force, other.force) and other.gravity_work == one.gravity_work != 0.0
    assert other.time == 0.1 and list(one.state())[0] == "impactor/ball/position"
