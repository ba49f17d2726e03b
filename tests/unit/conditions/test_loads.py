import numpy as np
import pytest

from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.conditions.time_functions import Ramp


def test_a_body_force_acts_and_works():
    load = BodyForce([1, 2], [[2.0, 0.0], [0.0, 3.0]], Ramp(0.0, 2.0))
    force = np.zeros((3, 2))
    load.add_to(force, 1.0)
    assert force.tolist() == [[0.0, 0.0], [1.0, 0.0], [0.0, 1.5]]
    load.do_work(np.full((3, 2), 10.0), 1.0, 0.5)  # mean of f(0.5) and f(1) is 0.375, displacement 5
    assert load.work.tolist() == [pytest.approx(0.375 * 2 * 5), pytest.approx(0.375 * 3 * 5)]


@pytest.mark.parametrize("quantity", ["displacement", "velocity"])
def test_prescribed_components_go_where_they_must(quantity):
    motion = PrescribedMotion([0], [1], [4.0], Ramp(0.0, 2.0), quantity)
    u, v = np.array([[7.0, 0.1], [0.0, 0.0]]), np.array([[1.0, 1.0], [1.0, 1.0]])
    motion.steer(u, v, 1.0, 0.5)
    target = 2.0 if quantity == "displacement" else 0.1 + 0.5 * 4.0 * 0.375  # velocity: f at the middle of the step
    assert u[0, 1] + 0.5 * v[0, 1] == pytest.approx(target)
    assert v[0, 0] == 1.0 and v[1].tolist() == [1.0, 1.0]
    motion.settle(v, 1.0)
    assert v[0, 1] == pytest.approx(2.0)  # 4/2 per second, or 4 m/s at half of the ramp


def test_the_work_of_holding_is_what_the_forces_do_not_do():
    motion = PrescribedMotion([0], [0], [1.0], Ramp(0.0, 1.0), "displacement")
    force, velocity = np.array([[5.0, 9.0]]), np.array([[2.0, 9.0]])
    motion.do_work(force, velocity, 0.1)
    assert motion.work[0] == pytest.approx(-0.5 * 5.0 * 2.0 * 0.1)
    assert motion.kinetic(velocity, np.array([1.5]))[0] == pytest.approx(6.0)


def test_each_particle_may_have_its_own_motion():
    motion = PrescribedMotion([2, 0], [1], [[4.0], [6.0]], Ramp(0.0, 2.0), "displacement")
    u, v = np.zeros((3, 2)), np.zeros((3, 2))
    motion.steer(u, v, 1.0, 0.5)
    assert (u + 0.5 * v)[:, 1].tolist() == [3.0, 0.0, 2.0]
    motion.settle(v, 1.0)
    assert v[:, 1].tolist() == [3.0, 0.0, 2.0]
