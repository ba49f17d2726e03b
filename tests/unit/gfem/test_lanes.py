"""Loops over rows of eight, against whole-array numpy."""
import numpy as np
import pytest

from pdhpc.gfem import lanes

ROWS = np.array([8, 24, 40], np.int32)
N = 56
LANES_OF = (ROWS[:, None] + np.arange(8)).ravel()


def fields(seed=1, count=3):
    """Return random fields by slot, each component together."""
    random = np.random.default_rng(seed)
    return [random.uniform(-1, 1, (2, N)).T for _ in range(count)]


def by_lane(values):
    """Return (8 n_rows, dim) of values (n_rows, dim, 8)."""
    return values.transpose(0, 2, 1).reshape(-1, values.shape[1])


def of_lanes(values):
    """The inverse of by_lane."""
    return np.ascontiguousarray(values.reshape(len(ROWS), 8, -1).transpose(0, 2, 1))


def test_kicks_and_drifts():
    velocity, force, position = fields()
    inverse = np.random.default_rng(0).uniform(0, 2, N)
    inverse[10] = 0.0
    v, u = velocity.copy(), position.copy()
    v[LANES_OF] += 0.3 * inverse[LANES_OF, None] * force[LANES_OF]
    u[LANES_OF] += 0.7 * v[LANES_OF]
    still = velocity[10].copy()
    lanes.kick_drift(ROWS, velocity, force, inverse, position, 0.3, 0.7)
    assert velocity == pytest.approx(v, abs=1e-15) and position == pytest.approx(u, abs=1e-15) and np.array_equal(velocity[10], still)
    v[LANES_OF] += 0.2 * inverse[LANES_OF, None] * force[LANES_OF]
    lanes.kick(ROWS, velocity, force, inverse, 0.2)
    assert velocity == pytest.approx(v, abs=1e-15)


def test_rows_are_remembered():
    position, velocity = fields(count=2)
    before, velocity_before = np.zeros((2, 3, 2, 8))
    lanes.remember(ROWS, position, velocity, before, velocity_before)
    assert np.array_equal(by_lane(before), position[LANES_OF]) and np.array_equal(by_lane(velocity_before), velocity[LANES_OF])


def test_a_collar_moves_as_a_parabola():
    position = fields(count=1)[0]
    u, v, a = (np.random.default_rng(seed).uniform(-1, 1, (4, 2)) for seed in range(3))
    slots = np.array([3, 17, 18, 50])
    others = np.setdiff1d(np.arange(N), slots)
    kept = position[others].copy()
    lanes.place(slots, u, v, a, 0.4, position)
    assert position[slots] == pytest.approx(u + 0.4 * v + 0.5 * 0.4**2 * a, abs=1e-15) and np.array_equal(position[others], kept)


@pytest.mark.parametrize("of_velocity", (False, True))
def test_states_are_blended_inside(of_velocity):
    position, velocity, start = fields()
    random = np.random.default_rng(5)
    inside, alpha = random.uniform(size=24) < 0.6, random.choice([0.0, 0.3, 0.8, 1.0], 24)
    before = of_lanes(start[LANES_OF])
    u, v = position.copy(), velocity.copy()
    chosen = LANES_OF[inside]
    if of_velocity:
        v[chosen] = alpha[inside, None] * velocity[chosen]
    else:
        u[chosen] = start[chosen] + alpha[inside, None] * (position[chosen] - start[chosen])
    lanes.blend_state(ROWS, inside, alpha, before, position, velocity, of_velocity)
    assert position == pytest.approx(u, abs=1e-15) and velocity == pytest.approx(v, abs=1e-15)


CELLS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6]], np.int32)


@pytest.mark.parametrize("idle", ([], [2, 4], [0, 1, 3, 4]), ids=("all act", "two do not", "none of a cell does"))
def test_right_sides_are_sums_over_lanes(idle):
    """Formulas 1 and 2 of the pinned scheme, lane by lane; lanes without a cell count nowhere, those outside enriched cells by their sums alone.

    What a cell has at vertices that do not act is shared by its others.
    """
    position, velocity, start = fields()
    random = np.random.default_rng(8)
    cell = random.integers(-1, 3, 24).astype(np.int32)
    inside, alpha, density = random.uniform(size=24) < 0.5, random.uniform(size=24), random.uniform(1, 2, 24)
    number, shape = random.integers(0, 5, 24).astype(np.uint16), np.zeros((5, 8))
    shape[:, :4] = random.uniform(size=(5, 4))
    sums, speed = random.uniform(-1, 1, (24, 2)), random.uniform(-1, 1, (24, 2))
    dt, volume = 0.3, 0.25
    acting = np.ones(8, bool)
    acting[idle] = False
    expected = np.zeros((2, 8, 2))
    for n in range(24):
        if cell[n] < 0:
            continue
        first, second = sums[n].copy(), sums[n].copy()
        if inside[n]:
            first += density[n] * (dt * speed[n] - alpha[n] * (position[LANES_OF[n]] - start[LANES_OF[n]]))
            second += density[n] * (speed[n] - alpha[n] * velocity[LANES_OF[n]])
        corners, weights = CELLS[cell[n]], volume * shape[number[n], :4]
        there = acting[corners]
        if there.any():
            weights = weights[there] + weights[~there].sum() / there.sum()
            for one, density_of in ((0, first), (1, second)):
                expected[one][corners[there]] += weights[:, None] * density_of
    result = np.full((2, 8, 2), 2.0)
    before, velocity_before, held = of_lanes(start[LANES_OF]), of_lanes(speed), of_lanes(sums)
    lanes.project_displacement(ROWS, cell, number, shape, alpha, inside, before, velocity_before, held, position, density, dt, volume, CELLS, acting, result[0])
    lanes.project_velocity(ROWS, cell, number, shape, alpha, inside, velocity_before, held, velocity, density, volume, CELLS, acting, result[1])
    assert result == pytest.approx(2.0 + expected, abs=1e-14)


def test_masses_are_lumped():
    lumped = np.random.default_rng(9).uniform(1, 2, (2, 4))
    result = np.full(8, 0.5)
    lanes.lump(CELLS, np.array([2, 0], np.int32), np.array([1, 0, 0], np.int32), lumped, result)
    expected = np.full(8, 0.5)
    expected[CELLS[2]] += lumped[0]
    expected[CELLS[0]] += lumped[1]
    assert result == pytest.approx(expected)
