"""Kernels of contact against plain sums over pairs."""
import numpy as np
import pytest

from pdhpc.kernels import contact as kernels
from pdhpc.kernels.contact import ContactLaw, Crowd, MetPoints, Pairs
from pdhpc.kernels.neighbours import cell_list
from pdhpc.warm_up import block

LAW = ContactLaw(np.array([[3.0, 2.0], [2.0, 5.0]]), np.array([1.5, 0.7]), 0.3, 0.15, 0.01)


def cloud(dim, n=60, seed=3):
    """Points of a dense random cloud, all of them owned, with all pairs listed; reference positions near the current ones."""
    random = np.random.default_rng(seed)
    side = (n / 3.0) ** (1 / dim)
    motion = np.concatenate([random.uniform(0, side, (n, dim)), random.standard_normal((n, dim))], axis=1)
    reference = motion[:, :dim] + random.uniform(-0.6, 0.6, (n, dim))
    points = MetPoints(motion, reference, random.uniform(0.4, 0.6, n), random.uniform(0.5, 1.5, n), random.integers(0, 2, n).astype(np.uint8), np.arange(n, dtype=np.int32))
    other = np.concatenate([np.delete(np.arange(n), i) for i in range(n)]).astype(np.int32)
    return points, Pairs(np.arange(n + 1) * (n - 1), other, np.ones(len(other), np.uint8))


def pair_force(points, law, i, j, dim):
    """Return (force on i, its part from friction and damping, energy of the pair), from the formulas at the top of kernels/contact.py."""
    x, v = points.motion[:, :dim], points.motion[:, dim:]
    r = np.linalg.norm(x[j] - x[i])
    limit = min(0.9 * np.linalg.norm(points.reference[j] - points.reference[i]), points.reach[i] + points.reach[j])
    if r >= limit:
        return np.zeros(dim), np.zeros(dim), 0.0
    n, (a, b) = (x[j] - x[i]) / r, points.block[[i, j]]
    k = law.stiffness[a, b] * points.volume[i] * points.volume[j]
    m_i, m_j = law.density[a] * points.volume[i], law.density[b] * points.volume[j]
    m, w = m_i * m_j / (m_i + m_j), v[j] - v[i]
    elastic = k * (limit - r)
    normal = max(0.0, elastic - 2 * law.damping * np.sqrt(k * m) * (w @ n))
    slip = w - (w @ n) * n
    tangential = min(law.friction * normal, m * np.linalg.norm(slip) / (4 * law.dt)) * slip / np.linalg.norm(slip)
    force = -normal * n + tangential
    return force, force + elastic * n, 0.5 * k * (limit - r) ** 2


def forces(points, pairs, law, third, inelastic, given=False):
    n, dim = points.reference.shape
    result = np.zeros((n, dim))
    kernels.add_contact_forces(pairs, points, law, third, np.arange(n), result, inelastic, given)
    return result


@pytest.mark.parametrize("dim, third", [(2, None), (3, 2)])
def test_forces_and_energies_are_sums_over_pairs(dim, third):
    points, pairs = cloud(dim)
    n = len(points.volume)
    inelastic = np.zeros((n, dim))
    found = forces(points, pairs, LAW, third, inelastic) * points.volume[:, None]
    table = [[pair_force(points, LAW, i, j, dim) for j in range(n) if j != i] for i in range(n)]
    assert np.allclose(found, [sum(each[0] for each in row) for row in table], atol=1e-12)
    assert np.allclose(inelastic, [sum(each[1] for each in row) for row in table], atol=1e-12)
    energy = np.zeros(n)
    kernels.contact_energies(pairs, points, LAW, third, np.arange(n), energy)
    assert energy.sum() == pytest.approx(0.5 * sum(each[2] for row in table for each in row)) and energy.sum() > 1.0
    touching = sum(each[2] > 0 for row in table for each in row)
    assert touching > n, "many pairs touch"


def test_action_is_reaction_to_the_last_bit():
    points, _ = cloud(3, 40)
    for i in range(40):
        for j in range(i):
            one = MetPoints(*(field[[i, j]] for field in points))._replace(slot=np.arange(2, dtype=np.int32), volume=np.ones(2))
            pair = Pairs(np.array([0, 1, 2]), np.array([1, 0], np.int32), np.ones(2, np.uint8))
            both = forces(one, pair, LAW, 2, np.zeros((2, 3)))
            assert np.array_equal(both[0], -both[1])


def test_only_free_pairs_count_and_given_friction_is_kept():
    points, pairs = cloud(2)
    n = len(points.volume)
    inelastic = np.zeros((n, 2))
    full = forces(points, pairs, LAW, None, inelastic)
    points.motion[:, 2:] = 0.0  # the velocities that decided it are gone
    assert np.array_equal(forces(points, pairs, LAW, None, inelastic, True), full)
    assert not np.array_equal(forces(points, pairs, LAW, None, inelastic), full)
    pairs.free[:] = 0
    assert not forces(points, pairs, LAW, None, inelastic).any()


def test_friction_never_turns_a_sliding_around():
    """The most that friction does in a step is to take away a quarter of the sliding of a pair."""
    points, _ = cloud(2, 2)
    points.motion[:] = [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 1e-6]]
    points.reference[:] = [[0.0, 0.0], [5.0, 0.0]]
    points.volume[:] = 1.0
    pair = Pairs(np.array([0, 1, 2]), np.array([1, 0], np.int32), np.ones(2, np.uint8))
    law = LAW._replace(friction=1e3, damping=0.0)
    found = forces(points, pair, law, None, np.zeros((2, 2)))
    mass = law.density[points.block]
    change = law.dt * (found[1, 1] / mass[1] - found[0, 1] / mass[0])
    assert change == pytest.approx(-0.25e-6, rel=1e-9)


def crowd(points, members, allowance, distance):
    """Return the Crowd of some points, as Contact makes it."""
    largest = allowance[members].max(initial=0.0)
    cells = cell_list(points.motion[members], distance + 2 * largest, 1)
    return Crowd(cells._replace(order=members[cells.order].astype(np.int32)), float(largest))


@pytest.mark.parametrize("n_fast", [0, 30, 200])
@pytest.mark.parametrize("dim, third", [(2, None), (3, 2)])
def test_near_pairs_are_all_there_in_order(dim, third, n_fast):
    """Within d_ij + a_i + a_j of each other, a_i = 0.1 but for some that are fast and may go as far as 1."""
    points, _ = cloud(dim, 200, 5)
    random = np.random.default_rng(0)
    ids, allowance, distance = random.permutation(200).astype(np.int64), np.full(200, 0.1), 2 * points.reach.max()
    allowance[random.choice(200, n_fast, False)] = random.uniform(0.2, 1.0, n_fast)
    sub, _ = block(dim, 4, 2.0)
    start, other, n_owned = np.zeros(151, np.int64), np.empty(100_000, np.int32), 150
    x = points.motion[:, :dim]
    points = points._replace(motion=np.ascontiguousarray(x))
    crowds = tuple(crowd(points, np.flatnonzero(some), allowance, distance) for some in (allowance <= 0.1, allowance > 0.1))
    arguments = crowds, distance, points, allowance, ids, third, sub.bonds.arrays, False, np.zeros(4096, np.bool_), start
    end = kernels.list_near(*arguments, other)
    for i in range(n_owned):
        r = np.linalg.norm(x - x[i], axis=1)
        limit = np.minimum(points.reach + points.reach[i], 0.9 * np.linalg.norm(points.reference - points.reference[i], axis=1)) + allowance + allowance[i]
        expected = [j for j in np.flatnonzero(r < limit) if j != i]
        expected.sort(key=lambda j: ids[j])
        assert other[start[i] : start[i + 1]].tolist() == expected
    assert start[-1] == end > 4 * n_owned
    assert kernels.list_near(*arguments, np.empty(7, np.int32)) == end, "too little room: counted all the same"


@pytest.mark.parametrize("path", ["lattice", "cloud"])
def test_pairs_are_free_where_no_bond_is_intact(path, lose_bonds):
    sub, _ = block(2, 5, 2.0, path=path)
    particles = sub.particles
    particles.place()
    n, x = particles.n_owned, sub.places()
    points = MetPoints(x.copy(), x, np.full(n, 0.7e-3), np.ones(n), np.zeros(n, np.uint8), particles.slots)
    stamp = np.zeros(len(particles.position), np.bool_)
    start, other = np.zeros(n + 1, np.int64), np.empty(1000, np.int32)
    allowance = np.full(n, 0.15e-3)
    crowds = crowd(points, np.arange(n), allowance, 1.4e-3), crowd(points, np.arange(0), allowance, 1.4e-3)
    arguments = crowds, 1.4e-3, points, allowance, particles.id[:n], None, sub.bonds.arrays
    end = kernels.list_near(*arguments, True, stamp, start, other)
    assert end == 0, "every near pair is bonded"
    end = kernels.list_near(*arguments, False, stamp, start, other)
    pairs, intact, has_free = Pairs(start, other[:end], np.full(end, 9, np.uint8)), np.full(n, -1, np.int32), np.ones(n, bool)
    seen = np.zeros(n, bool)
    kernels.free_pairs(sub.bonds.arrays, pairs, points, stamp, intact, has_free, seen)
    assert not pairs.free.any() and not has_free.any() and not stamp.any() and not seen.any()
    lose_bonds(sub, 12)
    kernels.free_pairs(sub.bonds.arrays, pairs, points, stamp, intact, has_free, seen)
    assert np.flatnonzero(has_free).tolist() == [12] and pairs.free[start[12] : start[13]].all() and pairs.free.sum() == start[13] - start[12]
    met = np.zeros(n, bool)
    kernels.mark_met(pairs, np.array([12]), met)
    assert np.array_equal(met, seen)
    assert set(np.flatnonzero(met)) == {12, *other[start[12] : start[13]].tolist()}


def test_the_stiffest_particle():
    """Two particles beside a body, pressed together along (3, 4)/5: |A_c| = k/V, on top of what their bonds have (none here)."""
    sub, law = block(2, 4, 2.0, path="cloud")
    sub.bonds.arrays.alive[:] = 0
    points, _ = cloud(2, 2)
    points.motion[:2, :2] = [[0.0, 0.0], [0.3, 0.4]]
    points.reference[:] = [[0.0, 0.0], [5.0, 0.0]]
    pair = Pairs(np.array([0, 1, 2]), np.array([1, 0], np.int32), np.ones(2, np.uint8))
    found = kernels.stiffest(pair, points, LAW, None, np.arange(2), sub.bonds.arrays, sub.points, law, None)
    expected = [LAW.stiffness[points.block[0], points.block[1]] * points.volume[1 - i] / LAW.density[points.block[i]] for i in (0, 1)]
    assert found == pytest.approx(max(expected), rel=1e-12)


def test_largest_motion():
    now, before, slots, allowance = np.array([[0.0, 0.0], [3.0, 4.0]]), np.zeros((2, 2)), np.array([0, 1], np.int32), np.array([6.0, 8.0])
    assert kernels.largest_motion(now, before, now, slots, allowance, 0.2) == (5.0, 5.0, 3.0, 0.5), "of 8 m 3 are left, and 4 were used before the last step of 1 m"
    assert kernels.largest_motion(now, before, now, slots[:1], allowance, 0.2) == (0.0, 0.0, 6.0, 0.0)
    now[0, 0] = np.nan
    assert kernels.largest_motion(now, before, before, slots, allowance, 0.2) == (np.inf, np.inf, -np.inf, np.inf)


def test_allowances_of_fast_particles():
    velocity, slots, allowance = np.array([[0.0, 0.0], [3.0, 4.0], [30.0, 40.0], [0.3, 0.4]]), np.array([3, 1, 2], np.int32), np.empty(3)
    growth = kernels.allow(velocity, slots, 0.1, 0.1, 2.0, 1.0, allowance)
    assert allowance == pytest.approx([0.1, 0.5, 2.0]) and growth == pytest.approx((1.2**2 + 1.6**2 + 3.1**2) / (3 * 1.2**2))
