import numpy as np
import pytest

from pdhpc.kernels import balance

SLOTS = np.array([3, 1], np.int32)  # of two owned particles among four slots
HELD = np.array([[True, False], [False, False]])
VOLUME = np.array([9.0, 2.0, 9.0, 0.5])


def fields(seed=0):
    random = np.random.default_rng(seed)
    return random.standard_normal((4, 2)), random.standard_normal((2, 2))


def test_squares_of_forces():
    force, loads = fields()
    squares = np.empty((3, 2))
    balance.square_forces(force, loads, HELD, VOLUME, SLOTS, squares)
    total, applied = VOLUME[SLOTS, None] * force[SLOTS], VOLUME[SLOTS, None] * loads
    assert squares[0] == pytest.approx((total**2 * ~HELD).sum(axis=1)) and squares[2] == pytest.approx((total**2 * HELD).sum(axis=1))
    assert squares[1] == pytest.approx((applied**2 * ~HELD).sum(axis=1))


def test_rayleigh_parts_of_springs():
    """Springs of stiffness k per volume to the ground: w . K w over w . D w is k/D."""
    displacement, start = fields()
    parts, stiffness = np.empty((2, 2)), 3.0
    balance.rayleigh_parts(-stiffness * displacement, -stiffness * start, displacement, start, np.array([5.0, 5.0]), HELD, VOLUME, SLOTS, parts)
    assert parts[0] == pytest.approx(parts[1] * stiffness / 5.0) and parts[1].min() > 0
    w = displacement[SLOTS[0], 1] - start[0, 1]  # the other component is held
    assert parts[1, 0] == pytest.approx(VOLUME[3] * 5.0 * w * w)


def test_a_step_of_relaxation():
    displacement, pace = fields()
    force, _ = fields(1)
    before, v, density, c = displacement.copy(), pace.copy(), np.array([4.0, 0.0]), 0.3
    balance.relax(displacement, pace, force, density, HELD, SLOTS, c)
    expected = ((2 - c) * v[0, 1] + 2 * force[3, 1] / 4.0) / (2 + c)
    assert displacement[3, 1] == pytest.approx(before[3, 1] + expected) and pace[0, 1] == pytest.approx(expected)
    changed = displacement != before
    assert changed.sum() == 1 and changed[3, 1], "held components, other slots and particles without a density stay"


def test_work_is_the_trapezium():
    force, loads = fields()
    displacement, before = fields(1)
    applied, old, work = np.ones((2, 2)), before.copy(), np.empty(2)
    balance.add_work(force, loads, HELD, displacement, before, applied, VOLUME, SLOTS, work)
    now = loads - np.where(HELD, force[SLOTS], 0.0)
    assert work == pytest.approx(VOLUME[SLOTS] * (0.5 * (1.0 + now) * (displacement[SLOTS] - old)).sum(axis=1))
    assert np.array_equal(applied, now) and np.array_equal(before, displacement[SLOTS])


def test_loads_are_added_to_owned_particles():
    force, loads = fields()
    before = force.copy()
    balance.add_loads(force, loads, SLOTS)
    assert np.array_equal(force[SLOTS], before[SLOTS] + loads) and np.array_equal(force[[0, 2]], before[[0, 2]])
