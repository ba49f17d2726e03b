"""Forces that fade out, against a double loop in numpy over the bonds of small bodies, and what else is asked of the particles on a ramp."""
import math

import numpy as np
import pytest

from pdhpc.kernels import blend, sweeps
from pdhpc.parallel.noise import noise
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.study.verify.case import plate, problem_of

WEIGHTS = np.array([0.7, -0.3])
HOLE = '[[body.hole]]\nshape = "disk"\ncenter = [1.5, 0.5]\nradius = 2.1\n'
BESIDE = """
[[material]]
name = "other"
density = 1.0
youngs_modulus = 3.0
[[body]]
name = "beside"
material = "other"
shape = "box"
lower = [8.5, -4.5]
upper = [14.5, 4.5]
"""
BODIES = {"2d": dict(cells=(17, 9)), "hole": dict(cells=(17, 9), hole=HOLE), "materials": dict(cells=(17, 9), extra=BESIDE), "3d": dict(cells=(10, 5, 4))}


def displaced(cells, hole="", extra="", material="", size=0.01):
    """Return (problem, alpha by slot) of a body with random displacements; alpha falls from 1 to 0 along x, with a kink at both ends."""
    text = plate(cells, 3.0, extra=extra, material=material, dimension="3d" if len(cells) == 3 else "plane_stress").replace("[time]", hole + "[time]")
    problem = problem_of(text)
    particles = problem.subdomain.particles
    particles.put(particles.displacement, size * noise(particles.id, particles.dim))
    particles.place()
    alpha = np.zeros(len(particles.position))
    alpha[particles.slots] = np.clip((4.3 - problem.subdomain.places()[:, 0]) / 6.0, 0.0, 1.0)
    return problem, alpha


def bonds_of(subdomain, intact_pairs):
    """Return (i, j, xi): owned rows of the ends of each intact directed bond, and the vectors between them."""
    i, j = np.array(sorted(intact_pairs(subdomain))).T
    x = subdomain.places()
    return i, j, x[j] - x[i]


def pulls(problem, intact_pairs):
    """Return (i, j, c beta s V_q e (n, dim), c beta s^2 |xi| V_q / 4 (n,)) of each bond, beta = min(1, delta + h/2 - |xi|) for h = 1, delta = 3."""
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    i, j, xi = bonds_of(subdomain, intact_pairs)
    u, block, volume = particles.owned(particles.position), particles.owned(particles.block), particles.owned(particles.volume)
    c, length = problem.body.law.micromodulus[block[i], block[j]], np.linalg.norm(xi, axis=1)
    c = c * np.minimum(1.0, 3.5 - length)
    stretch = ((u[j] - u[i]) * xi).sum(axis=1) / length**2
    return i, j, (c * stretch * volume[j] / length)[:, None] * xi, 0.25 * c * stretch**2 * length * volume[j]


def arguments(problem, alpha, rows=None):
    """Return what blended_forces takes, and its sums over the sub-steps."""
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    rows = np.concatenate(subdomain.rows) if rows is None else rows
    sums = [np.full((len(rows), particles.dim, 8), start) for start in (5.0, -2.0)]
    force = np.full(particles.position.shape[::-1], 99.0).T
    bodies = subdomain.bonds.arrays, subdomain.points, problem.body.law, particles.third
    return (*bodies, rows, alpha, np.ones(len(alpha)), force, particles.dissipated, WEIGHTS, *sums, np.zeros(len(rows), bool)), force, sums


def by_owned(subdomain, rows, values):
    """Return (n_owned, dim) of values (n_rows, dim, 8)."""
    slots = subdomain.particles.slots
    row = np.searchsorted(rows, slots // 8 * 8) if np.all(np.diff(rows) > 0) else np.array([np.flatnonzero(rows == slot // 8 * 8)[0] for slot in slots])
    return values[row, :, slots % 8]


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("sweep", ("vectors", "by bond"))
def test_forces_fade_as_the_double_loop_says(body, sweep, intact_pairs):
    problem, alpha = displaced(**BODIES[body])
    call, force, sums = arguments(problem, alpha)
    function = blend.blended_forces if sweep == "vectors" else blend.blended_forces_by_bond
    assert function(*call) == 0
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    i, j, pull, _ = pulls(problem, intact_pairs)
    a = alpha[particles.slots]
    whole, faded = np.zeros((2, particles.n_owned, particles.dim))
    np.add.at(whole, i, pull)
    np.add.at(faded, i, 0.5 * (a[i] + a[j])[:, None] * pull)
    size = np.abs(whole).max()
    assert particles.owned(force) == pytest.approx(whole, abs=1e-13 * size)
    for weight, start, found in zip(WEIGHTS, (5.0, -2.0), sums):
        assert by_owned(subdomain, call[4], found) == pytest.approx(start + weight * faded, abs=1e-13 * size + 1e-15)
    assert np.abs(faded.sum(axis=0)).max() < 1e-13 * size * len(i) and 0.0 < np.abs(whole - faded).max(), "action equals reaction on the ramp"


@pytest.mark.parametrize("body", BODIES)
def test_where_alpha_is_one_forces_are_the_plain_ones(body):
    problem, alpha = displaced(**BODIES[body])
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    call, force, sums = arguments(problem, np.ones_like(alpha))
    blend.blended_forces(*call)
    plain = np.zeros(particles.position.shape[::-1]).T
    sweeps.bond_forces(subdomain.bonds.arrays, subdomain.points, problem.body.law, None, True, particles.third, call[4], plain, particles.dissipated)
    assert np.array_equal(particles.owned(force), particles.owned(plain)), "to the last bit: a row may change its sweep when patches grow"
    assert by_owned(subdomain, call[4], sums[0]) == pytest.approx(5.0 + WEIGHTS[0] * particles.owned(plain), rel=1e-14)


@pytest.mark.parametrize("sweep", (blend.blended_forces, blend.blended_forces_by_bond))
def test_bonds_break_as_in_the_plain_sweep_and_exert_nothing(sweep):
    found = []
    for plain in (True, False):
        problem, alpha = displaced((17, 9), material="critical_stretch = 0.004")
        subdomain, particles = problem.subdomain, problem.subdomain.particles
        call, force, sums = arguments(problem, np.ones_like(alpha))
        if plain:
            broken = sweeps.bond_forces(*call[:3], None, True, particles.third, call[4], force, particles.dissipated)
        else:
            broken = sweep(*call)
            once = -2.0 + WEIGHTS[1] * particles.owned(force)
            assert by_owned(subdomain, call[4], sums[1]) == pytest.approx(once, rel=1e-13), "rows that lost bonds are summed once"
        found.append((broken, subdomain.bonds.alive(), particles.owned(force).copy(), particles.owned(particles.dissipated).copy()))
    assert found[0][0] == found[1][0] > 100
    assert np.array_equal(found[0][1], found[1][1]) and found[0][2] == pytest.approx(found[1][2], abs=1e-15) and np.array_equal(found[0][3], found[1][3])


def test_bonds_of_particles_that_do_not_move_are_not_watched():
    problem, alpha = displaced((17, 9), material="critical_stretch = 0.004")
    call, _, _ = arguments(problem, alpha)
    call[6][:] = 0.0
    assert blend.blended_forces(*call) == 0
    call[6][:] = 1.0
    assert blend.blended_forces(*call) > 100


def test_only_the_rows_asked_for_are_done():
    problem, alpha = displaced((17, 9))
    some = np.concatenate(problem.subdomain.rows)[1:3]
    call, force, sums = arguments(problem, alpha, some)
    blend.blended_forces(*call)
    done = np.zeros(len(force), bool)
    done[(some[:, None] + np.arange(8)).ravel()] = True
    assert np.all(force[~done] == 99.0) and not np.any(force[done] == 99.0)


@pytest.mark.parametrize("body", BODIES)
def test_blended_forces_are_the_slopes_of_blended_energies(body, intact_pairs):
    """E = sum_p V_p energy_p is quadratic in u, so that a central difference of any size is exact."""
    problem, alpha = displaced(**BODIES[body])
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    energy, slots = np.empty(particles.n_owned), particles.slots
    call, _, sums = arguments(problem, alpha)
    blend.blended_forces(*call)
    force = (by_owned(subdomain, call[4], sums[0]) - 5.0) / WEIGHTS[0]

    def total():
        blend.blended_energies(subdomain.bonds.arrays, subdomain.points, problem.body.law, particles.third, slots, alpha, energy)
        return particles.owned(particles.volume) @ energy

    i, j, _, part = pulls(problem, intact_pairs)
    expected = np.zeros(particles.n_owned)
    np.add.at(expected, i, 0.5 * (alpha[slots][i] + alpha[slots][j]) * part)
    total()
    assert energy == pytest.approx(expected, abs=1e-13 * expected.max()) and expected.max() > 1e-6
    for row in (0, particles.n_owned // 2, particles.n_owned - 3):
        for axis in range(particles.dim):
            ends = []
            for step in (0.02, -0.04):
                particles.position[slots[row], axis] += step
                ends.append(total())
            particles.position[slots[row], axis] += 0.02
            assert force[row, axis] == pytest.approx(-(ends[0] - ends[1]) / 0.04, rel=1e-9, abs=1e-13), "unit volumes"


def test_energies_where_alpha_is_one_are_the_plain_ones():
    problem, alpha = displaced((17, 9))
    particles, energy = problem.subdomain.particles, np.empty(17 * 9)
    blend.blended_energies(problem.subdomain.bonds.arrays, problem.subdomain.points, problem.body.law, None, particles.slots, np.ones_like(alpha), energy)
    assert energy == pytest.approx(strain_energy_density(problem.subdomain, problem.body.law), rel=1e-13)


def test_status_is_what_bonds_reach(intact_pairs, lose_bonds):
    problem, alpha = displaced((24, 9), hole=HOLE)
    particles = problem.subdomain.particles
    pairs, a = intact_pairs(problem.subdomain), alpha[particles.slots]
    lose_bonds(problem.subdomain, 40)  # changes nothing
    found = np.full(particles.n_owned, 9, np.int8)
    blend.find_blended(problem.subdomain.bonds.arrays, particles.block, particles.slots, alpha, found)
    for row in range(particles.n_owned):
        near = a[[row] + [j for i, j in pairs if i == row]]
        assert found[row] == (0 if np.all(near == 0.0) else 2 if np.all(near == 1.0) else 1)
    assert set(found) == {0, 1, 2}


def test_strained_or_broken():
    """Under u_x = e x the largest stretch is that of bonds along x, e, if there is one: particles on the right of x = 0 have it."""
    problem, _ = displaced((17, 9), material="critical_stretch = 0.01")
    subdomain, particles, x = problem.subdomain, problem.subdomain.particles, problem.subdomain.places()
    u = np.zeros_like(x)
    u[:, 0] = 0.006 * np.maximum(x[:, 0], 0.0)
    particles.put(particles.position, u)
    flags = np.zeros(len(x), bool)

    def marked(share):
        blend.strained_or_broken(subdomain.bonds.arrays, subdomain.points, problem.body.law, None, particles.slots, share, flags)
        return flags.copy()

    assert np.array_equal(marked(0.59), x[:, 0] >= -0.5) and not marked(0.61).any(), "particles at x = -1 see strained bonds of 2/3 and less of it"
    row = 3
    subdomain.bonds.arrays.alive[0, particles.slots[row]] &= ~np.uint64(1 << 20)
    inside = np.flatnonzero(marked(10.0))
    assert inside.tolist() == [row], "a broken bond marks; those that reach out of the body do not count as broken"


@pytest.mark.parametrize("body", BODIES)
def test_moduli_give_the_energy_of_any_uniform_strain(body):
    problem, _ = displaced(**BODIES[body])
    subdomain, particles, law = problem.subdomain, problem.subdomain.particles, problem.body.law
    dim, size = particles.dim, 3 if particles.dim == 2 else 6
    subdomain.bonds.arrays.alive[0, particles.slots[10]] &= np.uint64(0b1011001 << 14)
    moduli = np.full((particles.n_owned, size, size), 7.0)
    blend.lattice_moduli(subdomain.bonds.arrays, subdomain.points, law, particles.third, particles.slots, moduli)
    gradient = 1e-3 * np.random.default_rng(3).uniform(-1, 1, (dim, dim))
    particles.put(particles.position, subdomain.places() @ gradient.T)
    strain = 0.5 * (gradient + gradient.T)
    voigt = [strain[d, d] for d in range(dim)] + [2 * strain[a, b] for a, b in ([(0, 1)] if dim == 2 else [(1, 2), (0, 2), (0, 1)])]
    assert 0.5 * np.einsum("a,nab,b->n", voigt, moduli, voigt) == pytest.approx(strain_energy_density(subdomain, law), rel=1e-12)
    assert moduli == pytest.approx(moduli.transpose(0, 2, 1), abs=1e-14)


def test_moduli_of_a_whole_family_of_the_square_lattice():
    """Horizon 3.015 h, linear volume correction: a sum over the square lattice; c is near 9 E / (pi delta^3), and nu near 1/3."""
    problem = problem_of(plate((17, 17), 3.015).replace("kinematics", 'volume_correction = "linear"\nkinematics'))
    particles = problem.subdomain.particles
    moduli = np.empty((1, 3, 3))
    centre = particles.slots[[17 * 8 + 8]]
    blend.lattice_moduli(problem.subdomain.bonds.arrays, problem.subdomain.points, problem.body.law, None, centre, moduli)
    horizon, expected = 3.015, np.zeros((3, 3))
    c = problem.body.law.micromodulus[0, 0]
    assert c == pytest.approx(9 / (math.pi * horizon**3), rel=0.2)
    for m in range(-4, 5):
        for n in range(-4, 5):
            r = math.hypot(m, n)
            if 0 < r < horizon + 0.5:
                v = np.array([m * m, n * n, m * n]) / r**2
                expected += 0.5 * c * min(1.0, horizon + 0.5 - r) * r * np.outer(v, v)
    assert moduli[0] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert expected[0, 1] == pytest.approx(expected[2, 2], rel=1e-14), "Cauchy's relation"
    assert expected[0, 0] == pytest.approx(3 * expected[0, 1], rel=0.06), "near isotropy"


@pytest.mark.parametrize("how", ("look", blend.blended_forces, blend.blended_forces_by_bond))
def test_rows_that_may_be_strained(how):
    """Rows of whoever strained_or_broken marks are seen, by a look or by a sweep of forces with a lower trigger, which breaks nothing."""
    problem, alpha = displaced((17, 9), material="critical_stretch = 0.01")
    subdomain, particles, x = problem.subdomain, problem.subdomain.particles, problem.subdomain.places()
    u = np.zeros_like(x)
    u[:, 0] = 0.006 * np.maximum(x[:, 0] - 2.0, 0.0)
    particles.put(particles.position, u)
    call, force, _ = arguments(problem, alpha)
    bonds, rows, moving, seen = call[0], call[4], call[6], call[-1]
    moving[:] = 0.0
    moving[particles.slots] = 1.0
    kept = {}

    def marked(share):
        seen[:] = False
        if how == "look":
            blend.strained_rows(bonds, subdomain.points, rows, moving, share, seen)
        else:
            assert how(bonds._replace(trigger=share * bonds.trigger), *call[1:]) == 0
            assert np.array_equal(kept.setdefault("force", force.copy()), force), "whatever is looked for"
        return seen.copy()

    strained = np.isin(rows, particles.slots[x[:, 0] >= 1.5] // 8 * 8)
    assert 0 < strained.sum() < len(rows) and np.array_equal(marked(0.59), strained) and not marked(0.61).any()
    moving[particles.slots[x[:, 0] >= 1.5]] = 0.0
    assert np.any(strained & (moving[rows[:, None] + np.arange(8)] > 0.0).any(axis=1)) and not marked(0.59).any(), "bonds of particles that do not move are not watched"


@pytest.mark.parametrize("sweep", (blend.blended_forces, blend.blended_forces_by_bond))
def test_rows_whose_bonds_break_are_seen(sweep):
    problem, alpha = displaced((17, 9), material="critical_stretch = 0.004")
    call, _, _ = arguments(problem, alpha)
    alive, rows, seen = call[0].alive, call[4], call[-1]
    before = alive.copy()
    assert sweep(*call) > 100
    lost = np.flatnonzero((alive != before).any(axis=0))
    assert np.array_equal(np.unique(lost // 8 * 8), np.sort(rows[seen])) and not seen.all()
