"""The pinned scheme: what is exact in it, and its limits of no patch and patches everywhere."""
import numpy as np
import pytest

from pdhpc.gfem.pinned import add_where
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.case import plate, problem_of

STEP = ("time.dt=1.2", "gfem.substeps=3", "time.end=12.0")
GRAVITY = '[[load]]\ntype = "force_density"\nregion = "all"\nvalue = [1e-3, -2e-3]\n'


def momentum(stepper):
    """Return the momentum: lumped masses outside, particles of unit mass inside."""
    local, solution = stepper.local, stepper.solution
    return solution.outside_mass @ solution.velocity + local.subdomain.particles.velocity[local.points.slots].sum(axis=0)


def of_all(stepper):
    """Return (displacements, velocities) of vertices that are standard, then of particles in patches, and their places."""
    local, solution = stepper.local, stepper.solution
    standard, slots, particles = ~stepper.patches.chosen, local.points.slots, local.subdomain.particles
    places = np.concatenate([solution.mesh.points[standard], local.subdomain.places_at(slots)])
    u = np.concatenate([solution.displacement[standard], particles.position[slots]])
    return u, np.concatenate([solution.velocity[standard], particles.velocity[slots]]), places


def set_velocity(stepper, field):
    """Give vertices and particles the velocities field (places)."""
    local, solution = stepper.local, stepper.solution
    solution.velocity[:] = np.where(stepper.scheme.mass.acting[:, None], field(solution.mesh.points), 0.0)
    local.subdomain.particles.velocity[local.points.slots] = field(local.subdomain.places_at(local.points.slots))


def test_a_translation_stays_what_it_is(coupled_body):
    stepper, speed = coupled_body(STEP).stepper(), np.array([1e-3, -4e-3])
    set_velocity(stepper, lambda x: np.broadcast_to(speed, x.shape))
    energy = stepper.ledger()["kinetic_energy"].sum()
    for _ in range(10):
        stepper.advance()
    u, v, _ = of_all(stepper)
    assert v == pytest.approx(np.broadcast_to(speed, v.shape), abs=1e-15) and u == pytest.approx(np.broadcast_to(12.0 * speed, u.shape), abs=1e-14)
    means = stepper.solution.displacement[np.isin(np.arange(len(stepper.solution.mesh.points)), stepper.solution.mesh.cells[~stepper.patches.whole])]
    assert means == pytest.approx(np.broadcast_to(12.0 * speed, means.shape), abs=1e-14), "nodal means wherever elements act"
    ledger = stepper.ledger()
    assert ledger["kinetic_energy"].sum() == pytest.approx(energy, rel=1e-13) and ledger["strain_energy"].sum() < 1e-20


def test_a_turn_is_kept(coupled_body):
    """The particles' velocities and those of hats that fade out are the same linear field, and so is their blend."""
    stepper = coupled_body(STEP).stepper()
    set_velocity(stepper, lambda x: 1e-3 * np.stack([-x[:, 1], x[:, 0]], axis=1))
    energy, errors = stepper.ledger()["kinetic_energy"].sum(), []
    for number in range(1, 11):
        stepper.advance()
        u, _, x = of_all(stepper)
        expected = 1.2e-3 * number * np.stack([-x[:, 1], x[:, 0]], axis=1)
        errors.append(np.linalg.norm(u - expected) / np.linalg.norm(expected))
    ledger = stepper.ledger()
    assert max(errors) < 1e-14
    assert ledger["kinetic_energy"].sum() + ledger["strain_energy"].sum() == pytest.approx(energy, rel=1e-12)


def test_a_body_falls_as_one(coupled_body):
    """Under a uniform force density b every point moves by b t^2/2, once the collar knows the acceleration of the step before."""
    stepper = coupled_body(STEP, extra=GRAVITY).stepper()
    b = np.array([1e-3, -2e-3])
    stepper.solution.acceleration[:] = stepper.solution.previous_acceleration[:] = b
    for _ in range(5):
        stepper.advance()
    u, v, _ = of_all(stepper)
    assert v == pytest.approx(np.broadcast_to(6.0 * b, v.shape), abs=1e-14) and u == pytest.approx(np.broadcast_to(18.0 * b, u.shape), abs=1e-13)
    work = stepper.ledger()["external_work"].sum()
    assert work == pytest.approx(384 * 18.0 * b @ b, rel=1e-12), "force times way, 384 particles of unit volume"


def test_momentum_is_conserved(coupled_body, shake):
    stepper = shake(coupled_body(STEP).stepper(), 1e-2)
    before = momentum(stepper)
    for _ in range(10):
        stepper.advance()
    assert momentum(stepper) == pytest.approx(before, abs=1e-12) and np.abs(before).max() > 0.1


def test_without_patches_it_is_central_differences(coupled_body):
    """u'' = M^-1 (-K u + b), K from forces of unit displacements."""
    stepper = coupled_body(STEP, tip=None, extra=GRAVITY).stepper()
    solution, n = stepper.solution, 2 * len(stepper.solution.mesh.points)
    matrix = np.empty((n, n))
    for column in range(n):
        solution.displacement[:] = np.eye(n)[column].reshape(-1, 2)
        solution.evaluate_elements()
        matrix[:, column] = -solution.force.ravel()
    mass = np.repeat(solution.outside_mass, 2)
    load = np.tile([1e-3, -2e-3], n // 2) * mass  # unit density
    random = np.random.default_rng(4)
    u, v = random.uniform(-1, 1, (2, n))
    solution.displacement[:], solution.velocity[:] = u.reshape(-1, 2), v.reshape(-1, 2)
    solution.evaluate(0.0)
    for _ in range(7):
        force = load - matrix @ u
        u = u + 1.2 * v + 0.72 * force / mass
        v = v + 0.6 * (force + load - matrix @ u) / mass
        stepper.advance()
    assert solution.displacement.ravel() == pytest.approx(u, abs=1e-11) and solution.velocity.ravel() == pytest.approx(v, abs=1e-11)


def test_with_patches_everywhere_it_is_the_particles_alone(coupled_body):
    crack = '[[crack]]\ntype = "polyline"\npoints = [[-13.0, 0.0], [-4.0, 0.0]]\n'
    stepper = coupled_body(STEP + ("gfem.everywhere=true",)).stepper()
    other = problem_of(plate((24, 16), extra=crack), ["time.dt=0.4", "time.end=0.4"])
    for particles in (stepper.local.subdomain.particles, other.subdomain.particles):
        particles.put(particles.displacement, 0.02 * noise(particles.id, 2))
        particles.place()
    particles = other.subdomain.particles
    plain = other.stepper()
    for _ in range(4):
        stepper.advance()
        for _ in range(3):
            plain.advance()
    u, v, _ = of_all(stepper)
    slots = stepper.local.points.slots
    mine = stepper.local.subdomain.particles
    assert np.all(stepper.patches.chosen) and len(slots) == 384
    for one, two in ((mine.position, particles.position), (mine.velocity, particles.velocity)):
        assert mine.owned(one) == pytest.approx(particles.owned(two), abs=1e-13)


def test_one_step_solves_the_formulas(coupled_body, shake):
    """A step from a rough state against dense matrices and right sides summed over lanes in numpy, formulas 1 and 2 of the module."""
    stepper = shake(coupled_body(STEP).stepper(), 1e-2)
    stepper.advance()
    solution, local, patches = stepper.solution, stepper.local, stepper.patches
    mesh, blended, lattice, particles, dt = solution.mesh, local.blended, local.lattice, local.subdomain.particles, stepper.dt
    n = len(mesh.points)
    d, v, force = solution.displacement.copy(), solution.velocity.copy(), solution.force.copy()
    u_before, v_before = particles.position.copy(), particles.velocity.copy()
    stepper.choose_patches()
    stepper.seed_particles()
    stepper.run_particles()
    eta = stepper.reconstruct()
    moved, speed = particles.position - u_before, particles.velocity.copy()
    hats = np.zeros((len(particles.position), n))
    slots, cells, numbers = local.slots_of(np.arange(24))
    hats[slots[:, None], mesh.cells[cells]] = lattice.shape[numbers]
    first, second = np.zeros((2, len(particles.position), 2))
    lanes = (blended.rows[:, None] + np.arange(8)).ravel()
    for target, sums in ((first, blended.impulse), (second, blended.moment)):
        target[lanes] = sums.transpose(0, 2, 1).reshape(-1, 2)
    swept = (local.rows[:, None] + np.arange(8)).ravel()  # where alpha is 1 as far as bonds reach the sums are the momenta
    first[swept], second[swept] = (speed - v_before)[swept], (moved - dt * v_before)[swept]
    a, inside = local.alpha[:, None], local.inside[:, None]
    faded = inside * (1.0 - a)
    ramp = hats.T @ (faded * hats)
    lumped = ramp.sum(axis=1) + solution.outside_mass
    acting = lumped > 1e-12
    tests = np.zeros_like(hats)  # what a cell has at vertices that do not act is shared by its others
    for cell in range(24):
        there, corners = slots[cells == cell], mesh.cells[cell]
        if acting[corners].any():
            mine, others = corners[acting[corners]], corners[~acting[corners]]
            tests[np.ix_(there, mine)] = hats[np.ix_(there, mine)] + hats[np.ix_(there, others)].sum(axis=1, keepdims=True) / len(mine)

    def divided(right, factor):
        result = factor * v
        result[acting] += ((right - factor * ramp @ v) / np.where(acting, lumped, 1.0)[:, None])[acting]
        result[~acting] = 0.0
        return result

    c = divided(tests.T @ (inside * (dt * v_before - a * moved) + second) + 0.5 * dt**2 * force, dt)
    stepper.scheme.solve(eta, stepper.time)
    standard = ~patches.chosen
    assert solution.displacement[standard] == pytest.approx((d + c)[standard], abs=1e-14)
    expected = u_before + a * moved + faded * (hats @ c)
    points = local.points.slots
    assert particles.position[points] == pytest.approx(expected[points], abs=1e-14)
    e = divided(tests.T @ (inside * (v_before - a * speed) + first) + 0.5 * dt * (force + solution.force), 1.0)
    assert particles.velocity[points] == pytest.approx((a * speed + faded * (hats @ e))[points], abs=1e-14)
    assert solution.velocity == pytest.approx(e, abs=1e-14) and np.abs(e).max() > 1e-3 and 0 < np.sum(~acting) < patches.chosen.sum()
    assert solution.acceleration[standard] == pytest.approx(((e - v) / dt)[standard], abs=1e-13)


def test_all_of_a_patch_is_enriched(coupled_body):
    stepper = coupled_body().stepper()
    assert [each.tolist() for each in stepper.scheme.enriched] == [[stepper.patches.chosen.sum()] * 2] * 2
    assert np.array_equal(stepper.scheme.weight(stepper.patches), stepper.patches.chosen)


def test_add_where():
    target = np.ones((3, 2))
    add_where(np.array([True, False, True]), np.arange(6.0).reshape(3, 2), target)
    assert target.tolist() == [[1.0, 2.0], [1.0, 1.0], [5.0, 6.0]]
