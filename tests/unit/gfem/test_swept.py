"""Rows of eight: which are swept and how, and what is kept of their lanes."""
import numpy as np

from pdhpc.gfem.swept import MIXED, MOVING, WHOLE, Blended, Collar, mark_rows, rows_with, set_alpha, take_lanes


def test_alpha_is_interpolated_and_snaps_to_its_ends():
    cells, shape = np.array([[0, 1, 2, 3]], np.int32), np.array([[0.1, 0.2, 0.3, 0.4], [0.25, 0.25, 0.25, 0.25]])
    alpha = np.full(6, 9.0)
    for weight, expected in (([1, 0, 0, 1], (0.5, 0.5)), ([1, 1, 1, 1 - 1e-11], (1.0, 1.0)), ([1e-13, 0, 0, 0], (0.0, 0.0)), ([0, 1, 0, 0], (0.2, 0.25))):
        set_alpha(np.array([4, 1]), np.zeros(2, np.int32), np.array([0, 1], np.uint16), cells, shape, np.array(weight, float), alpha)
        assert np.allclose(alpha[[4, 1]], expected, rtol=1e-15, atol=0.0) and np.all(alpha[[0, 2, 3, 5]] == 9.0)
        assert not set(expected) & {0.0, 1.0} or tuple(alpha[[4, 1]]) == expected


def test_rows_are_marked_by_their_particles():
    status, inverse = np.zeros(36, np.int8), np.zeros(36)
    status[9], status[18], status[20], inverse[[9, 18, 20, 25]] = 2, 2, 1, 0.5
    marks = np.full(5, 7, np.uint8)
    mark_rows(np.array([8, 9, 17, 16, 30, 33]), status, inverse, marks)
    assert marks.tolist() == [7, WHOLE | MOVING, WHOLE | MIXED | MOVING, MOVING, 0], "the row that nobody asked for stays, and the last one is short"
    assert rows_with(marks, WHOLE, MIXED).tolist() == [8] and rows_with(marks, MIXED, 0).tolist() == [0, 16] and rows_with(marks, MOVING, 0).tolist() == [0, 8, 16, 24]
    status[20] = 2
    mark_rows(np.array([20]), status, inverse, marks)
    assert marks[2] == WHOLE | MOVING, "marks are set anew"
    inverse[20] = 0.0
    mark_rows(np.array([20]), status, inverse, marks)
    assert marks[2] == WHOLE | MIXED | MOVING, "what acts on a particle that does not move is not to be had from its motion"


def test_lanes_take_what_their_slots_say():
    random = np.random.default_rng(1)
    status, cell, number = random.integers(0, 3, 32).astype(np.int8), random.integers(1, 9, 32).astype(np.int32), random.integers(0, 16, 32).astype(np.uint16)
    alpha, inside, block, density = random.uniform(size=32), random.uniform(size=32) < 0.5, random.integers(0, 2, 32).astype(np.uint8), np.array([3.0, 5.0])
    block[status == 0] = 255
    table = random.uniform(size=(16, 4))
    blended = Blended(np.array([8, 24], np.int32), table, 2)
    take_lanes(blended.rows, status, cell, number, alpha, inside, block, density, *blended.lanes)
    slots = np.r_[8:16, 24:32]
    mine = status[slots] > 0
    assert 0 < mine.sum() < 16
    assert np.array_equal(blended.cell, np.where(mine, cell[slots] - 1, -1)) and np.array_equal(blended.inside, inside[slots] & mine)
    assert np.array_equal(blended.alpha, alpha[slots]) and np.array_equal(blended.shape, table[number[slots]])
    assert np.array_equal(blended.density[mine], density[block[slots][mine]]) and not blended.density[~mine].any()
    assert blended.impulse.shape == blended.before.shape == (2, 2, 8)


def test_a_collar_starts_at_rest():
    collar = Collar(np.array([3, 5]), np.zeros(2, np.int32), np.zeros(2, np.uint16), 2)
    assert collar.displacement.shape == (2, 2) and not collar.displacement.any() and not collar.velocity.any() and not collar.acceleration.any()
