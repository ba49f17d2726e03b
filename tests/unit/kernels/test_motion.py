import itertools

import numpy as np
import pytest

from pdhpc.kernels.motion import drift, drift_by_mass, first_not_finite, kick, kick_by_mass, kick_drift, kick_drift_by_mass, kinetic_energies, place
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


def test_kick_uses_each_block_s_density():
    velocity, force = np.zeros((2, 2)), np.array([[1.0, 2.0], [3.0, 4.0]])
    kick(velocity, force, np.array([0.5, 0.1]), np.array([1, 0], np.uint8), 2.0)
    assert np.allclose(velocity, [[0.2, 0.4], [3.0, 4.0]])


@pytest.mark.parametrize("linear", [False, True])
def test_drift_and_place_agree(linear):
    reference, velocity = np.random.default_rng(0).random((3, 4)), np.random.default_rng(1).random((3, 3))
    displacement, position, again = np.full((3, 3), 0.25), np.zeros((3, 4)), np.zeros((3, 4))
    drift(displacement, velocity, reference, position, linear or None, 0.5)
    assert np.array_equal(displacement, 0.25 + 0.5 * velocity)
    assert np.array_equal(position[:, :3], displacement if linear else reference[:, :3] + displacement)
    place(reference, displacement, again, linear or None)
    assert np.array_equal(again, position)


def test_kick_drift_of_arrays_is_kick_then_drift():
    random = np.random.default_rng(2)
    start = [random.standard_normal((5, 3)) for _ in range(3)]
    reference, inverse, block = random.random((5, 4)), np.array([0.3, 0.7]), np.array([0, 1, 0, 1, 1], np.uint8)
    for linear in (False, True):
        (v, f, u), (w, g, s) = ([a.copy() for a in start] for _ in range(2))
        x, y = np.zeros((5, 4)), np.zeros((5, 4))
        kick(v, f, inverse, block, 0.1)
        drift(u, v, reference, x, linear or None, 0.2)
        kick_drift(w, g, inverse, block, s, reference, y, linear or None, 0.1, 0.2)
        assert np.array_equal(v, w) and np.array_equal(u, s) and np.array_equal(x, y) and not np.array_equal(u, start[2])


TWO_MATERIALS = """
[[material]]
name = "other"
density = 3.0
youngs_modulus = 2.0
[[body]]
name = "beside"
material = "other"
shape = "box"
lower = {lower}
upper = {upper}
"""


def moving(path, cells, linear, blocks, seed=5):
    """Return (particles, places, 1/rho by block) of a box, of two materials when blocks is 2, with random motion and forces."""
    half = [c / 2 for c in cells]
    beside = TWO_MATERIALS.format(lower=[half[0]] + [-h for h in half[1:]], upper=[half[0] + 3.0] + half[1:])
    text = plate(cells, 2.0, kinematics="linear" if linear else "finite", dimension="3d" if len(cells) == 3 else "plane_stress", extra=beside if blocks == 2 else "")
    problem = problem_of(text, [f"particles.path={path}", "time.dt=0.01"])
    particles = problem.subdomain.particles
    random = np.random.default_rng(seed)
    for field in (particles.displacement, particles.velocity, particles.force_density):
        particles.put(field, random.standard_normal((particles.n_owned, particles.dim)))
    inverse = np.zeros(256)
    inverse[:blocks] = (0.37, 0.11)[:blocks]
    return particles, problem.subdomain.places(), inverse


WIDTHS = ((13, 3), (16, 5), (5, 7), (1, 1), (8, 24), (3, 4, 11), (4, 4, 4))  # whole blocks of eight, odd rests, and less than a block


@pytest.mark.parametrize("path, cells, linear, blocks", list(itertools.product(PATHS, WIDTHS, (False, True), (1, 2))))
def test_every_motion_is_the_formula_bit_for_bit(path, cells, linear, blocks):
    particles, x, inverse = moving(path, cells, linear, blocks)
    u, v, f = (particles.owned(field).copy() for field in (particles.displacement, particles.velocity, particles.force_density))
    factor = inverse[particles.owned(particles.block)][:, None]
    particles.place()
    assert np.array_equal(particles.owned(particles.position)[:, : particles.dim], u if linear else x + u)
    particles.kick_drift(inverse, 0.05, 0.1)
    kicked, drifted, placed = (particles.owned(field).copy() for field in (particles.velocity, particles.displacement, particles.position))
    assert np.allclose(kicked, v + 0.05 * factor * f, rtol=1e-14, atol=1e-15) and np.allclose(drifted, u + 0.1 * kicked, rtol=1e-14, atol=1e-15)
    assert np.array_equal(placed[:, : particles.dim], drifted if linear else x + drifted)
    for field, values in ((particles.displacement, u), (particles.velocity, v)):
        particles.put(field, values)
    particles.kick(inverse, 0.05)
    particles.drift(0.1)
    assert np.array_equal(particles.owned(particles.velocity), kicked) and np.array_equal(particles.owned(particles.displacement), drifted)
    assert np.array_equal(particles.owned(particles.position), placed), "in one pass or in two: the same bits"


@pytest.mark.parametrize("cells, linear", list(itertools.product(((13, 3), (3, 4, 11)), (False, True))))
def test_both_layouts_move_to_the_same_bits(cells, linear):
    found = []
    for path in PATHS:
        particles, _, inverse = moving(path, cells, linear, 1)
        particles.kick_drift(inverse, 0.05, 0.1)
        found.append([particles.owned(field)[:, : particles.dim].copy() for field in (particles.velocity, particles.displacement, particles.position)])
    assert all(np.array_equal(a, b) for a, b in zip(*found))


def test_cells_that_hold_no_particle_stay_at_rest():
    hole = '[[body.hole]]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 2.6\n'
    particles = problem_of(plate((13, 9), 2.0).replace("[time]", hole + "[time]"), ["particles.path=lattice"]).subdomain.particles
    particles.put(particles.velocity, np.ones((particles.n_owned, 2)))
    particles.put(particles.force_density, np.ones((particles.n_owned, 2)))
    inverse = np.zeros(256)
    inverse[0] = 1.0
    particles.kick_drift(inverse, 0.5, 1.0)
    empty = np.ones(len(particles.position), bool)
    empty[particles.slots] = False
    assert np.all(particles.velocity[empty] == 0.0) and np.all(particles.displacement[empty] == 0.0)
    assert np.all(particles.owned(particles.displacement) == 1.5)


def test_the_first_row_that_is_not_finite():
    field, rows = np.zeros((5, 3)), np.arange(5, dtype=np.int32)
    assert first_not_finite(field, rows) == -1
    field[3, 1] = np.nan
    field[4, 0] = np.inf
    assert first_not_finite(field, rows) == 3
    assert first_not_finite(field, rows[4:]) == 0
    assert first_not_finite(field, rows[[2, 4, 3]]) == 1


def test_kinetic_energies_of_chosen_slots():
    velocity, volume, energy = np.array([[3.0, 4.0], [1.0, 0.0], [0.0, 2.0]]), np.array([2.0, 5.0, 7.0]), np.empty(2)
    kinetic_energies(velocity, volume, np.array([0, 0, 1], np.uint8), np.array([10.0, 100.0]), np.array([2, 0], np.int32), energy)
    assert energy.tolist() == [0.5 * 100 * 7 * 4, 0.5 * 10 * 2 * 25]


def test_nodes_are_kicked_by_their_mass():
    """v + dt f / m and u + dt v of all slots; where the inverse mass is 0 nothing moves."""
    rng = np.random.default_rng(3)
    v, f, u = (rng.standard_normal((3, 16)) for _ in range(3))
    inverse_mass = np.r_[rng.random(15), 0.0]
    expected = v + 0.5 * inverse_mass * f
    kicked, moved = v.copy(), u.copy()
    kick_by_mass(kicked, f, inverse_mass, 0.5)
    assert np.allclose(kicked, expected, rtol=1e-15, atol=1e-15) and np.array_equal(kicked[:, 15], v[:, 15])
    drift_by_mass(moved, kicked, 0.25)
    assert np.allclose(moved, u + 0.25 * expected, rtol=1e-15, atol=1e-15)
    both = v.copy(), u.copy()
    kick_drift_by_mass(both[0], f, inverse_mass, both[1], 0.5, 0.25)
    assert np.array_equal(both[0], kicked) and np.array_equal(both[1], moved)
