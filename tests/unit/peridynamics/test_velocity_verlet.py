import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of


def shaken(extra=""):
    problem = problem_of(plate((10, 6), extra=extra, material="critical_stretch = 0.02", kinematics="finite"))
    particles = problem.subdomain.particles
    particles.velocity[:] = 0.05 * np.random.default_rng(0).standard_normal(particles.velocity.shape)
    return problem


def test_one_step_is_the_formula():
    problem = problem_of(plate((6, 6)))
    particles = problem.subdomain.particles
    particles.velocity[:] = np.random.default_rng(0).standard_normal(particles.velocity.shape)
    stepper = problem.stepper()
    u, v, a, dt = particles.displacement.copy(), particles.velocity.copy(), particles.force_density.copy(), stepper.dt  # rho = 1
    stepper.advance()
    assert np.allclose(particles.displacement, u + dt * (v + 0.5 * dt * a), rtol=1e-14)
    assert np.allclose(particles.velocity, v + 0.5 * dt * (a + particles.force_density), rtol=1e-13)
    assert stepper.time == dt and stepper.step == 1


def test_state_continues_a_run_bit_for_bit():
    problem = shaken()
    stepper = problem.stepper()
    for _ in range(20):
        stepper.advance()
    saved = {key: np.copy(get()) for key, (get, put) in stepper.state().items()}
    for _ in range(20):
        stepper.advance()
    assert stepper.broken > 0
    other = shaken()
    for key, (get, put) in other.stepper().state().items():
        put(saved[key])
    again = other.stepper()
    again.step = int(saved["step"])
    for _ in range(20):
        again.advance()
    assert np.array_equal(again.subdomain.particles.displacement, stepper.subdomain.particles.displacement)
    assert np.array_equal(again.subdomain.bonds.arrays.alive, stepper.subdomain.bonds.arrays.alive)


def test_ledger_sums():
    problem = shaken()
    stepper = problem.stepper()
    ledger = stepper.ledger()
    velocity = stepper.subdomain.particles.velocity
    assert ledger["kinetic_energy"].sum() == pytest.approx(0.5 * np.square(velocity).sum())  # rho = V = 1
    assert ledger["strain_energy"].sum() < 1e-25 and ledger["dissipated_energy"].sum() == 0.0 and ledger["external_work"].size == 0
    for _ in range(30):
        stepper.advance()
    after = stepper.ledger()
    assert after["strain_energy"].sum() > 0 and after["dissipated_energy"].sum() > 0


def test_seconds_are_counted_by_phase():
    stepper = shaken().stepper()
    stepper.advance()
    assert set(stepper.seconds) == {"force", "exchange", "integrate"} and stepper.seconds["force"] > 0
