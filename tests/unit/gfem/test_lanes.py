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


def test_nodal_fields_are_added_at_points():
    """Three particles at a time on a line, along which functions are linear."""
    field = fields(count=1)[0]
    random = np.random.default_rng(6)
    nodal, ends = random.uniform(-1, 1, (8, 2)), random.uniform(size=(2, 2, 4))
    shape = np.concatenate([[first, 0.5 * (first + last), last] for first, last in ends])
    slots, cell = np.array([[4, 5, 6, 30, 31, 32], [53, 54, 55, 12, 13, 14]]), np.array([2, 0], np.int32)
    expected = field.copy()
    for c in range(2):
        for p in range(6):
            expected[slots[c, p]] += shape[p] @ nodal[CELLS[cell[c]]]
    lanes.add_nodal(slots, cell, shape, 3, CELLS, nodal, field)
    assert field == pytest.approx(expected, abs=1e-15)


def test_right_sides_are_sums_over_lanes():
    """Formulas 1 and 2 of the pinned scheme, lane by lane; lanes without a cell count nowhere, those outside enriched cells by their sums alone."""
    position, velocity, start = fields()
    random = np.random.default_rng(8)
    cell = random.integers(-1, 3, 24).astype(np.int32)
    inside, alpha, density = random.uniform(size=24) < 0.5, random.uniform(size=24), random.uniform(1, 2, 24)
    number, shape = random.integers(0, 5, 24).astype(np.uint16), np.zeros((5, 8))
    shape[:, :4] = random.uniform(size=(5, 4))
    sums, speed = random.uniform(-1, 1, (24, 2)), random.uniform(-1, 1, (24, 2))
    dt, volume = 0.3, 0.25
    expected = np.zeros((2, 8, 2))
    for n in range(24):
        if cell[n] < 0:
            continue
        first, second = sums[n].copy(), sums[n].copy()
        if inside[n]:
            first += density[n] * (dt * speed[n] - alpha[n] * (position[LANES_OF[n]] - start[LANES_OF[n]]))
            second += density[n] * (speed[n] - alpha[n] * velocity[LANES_OF[n]])
        for a in range(4):
            expected[0, CELLS[cell[n], a]] += volume * shape[number[n], a] * first
            expected[1, CELLS[cell[n], a]] += volume * shape[number[n], a] * second
    result = np.full((2, 8, 2), 2.0)
    before, velocity_before, held = of_lanes(start[LANES_OF]), of_lanes(speed), of_lanes(sums)
    lanes.project_displacement(ROWS, cell, number, shape, alpha, inside, before, velocity_before, held, position, density, dt, volume, CELLS, result[0])
    lanes.project_velocity(ROWS, cell, number, shape, alpha, inside, velocity_before, held, velocity, density, volume, CELLS, result[1])
    assert result == pytest.approx(2.0 + expected, abs=1e-14)


def test_masses_are_lumped():
    lumped = np.random.default_rng(9).uniform(1, 2, (2, 4))
    result = np.full(8, 0.5)
    lanes.lump(CELLS, np.array([2, 0], np.int32), np.array([1, 0, 0], np.int32), lumped, result)
    expected = np.full(8, 0.5)
    expected[CELLS[2]] += lumped[0]
    expected[CELLS[0]] += lumped[1]
    assert result == pytest.approx(expected)
