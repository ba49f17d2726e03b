import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import MODELS, PATHS


BOTH_MODELS = [["material.solid.model=pmb"], ["material.solid.model=lps", "material.solid.poissons_ratio=0.2"]]


def shaken(path, overrides=()):
    problem = problem_of(plate((10, 6), material="critical_stretch = 0.02", kinematics="finite"), [f"particles.path={path}", *overrides])
    particles = problem.subdomain.particles
    particles.put(particles.velocity, 0.05 * np.random.default_rng(0).standard_normal((60, 2)))
    return problem


@pytest.mark.parametrize("path", PATHS)
def test_one_step_is_the_formula(path):
    problem = problem_of(plate((6, 6)), [f"particles.path={path}"])
    particles = problem.subdomain.particles
    particles.put(particles.velocity, np.random.default_rng(0).standard_normal((36, 2)))
    stepper = problem.stepper()
    u, v, a, dt = particles.displacement.copy(), particles.velocity.copy(), particles.force_density.copy(), stepper.dt  # rho = 1
    stepper.advance()
    assert np.allclose(particles.displacement, u + dt * (v + 0.5 * dt * a), rtol=1e-14)
    assert np.allclose(particles.velocity, v + 0.5 * dt * (a + particles.force_density), rtol=1e-13)
    assert stepper.time == dt and stepper.step == 1


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("overrides", BOTH_MODELS, ids=MODELS)
def test_state_continues_a_run_bit_for_bit(path, overrides):
    problem = shaken(path, overrides)
    stepper = problem.stepper()
    for _ in range(20):
        stepper.advance()
    saved = {key: np.copy(get()) for key, (get, put, *_) in stepper.state().items()}
    for _ in range(20):
        stepper.advance()
    assert stepper.broken > 0
    other = shaken(path, overrides)
    for key, (get, put, *_) in other.stepper().state().items():
        put(saved[key])
    again = other.stepper()
    again.step = int(saved["step"])
    for _ in range(20):
        again.advance()
    assert np.array_equal(again.subdomain.particles.displacement, stepper.subdomain.particles.displacement)
    assert np.array_equal(again.subdomain.bonds.arrays.alive, stepper.subdomain.bonds.arrays.alive)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("overrides", BOTH_MODELS, ids=MODELS)
def test_ledger_sums(path, overrides):
    problem = shaken(path, overrides)
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
    stepper = shaken("lattice").stepper()
    stepper.advance()
    assert set(stepper.seconds) == {"force", "exchange", "wait", "integrate"} and stepper.seconds["force"] > 0


def test_forces_are_state_where_the_energy_of_state_based_bonds_decides():
    """Bonds that broke in the last evaluation had a part in the dilatations that its forces came of."""
    words = 'model = "lps"\npoissons_ratio = 0.3\nenergy_release_rate = 1e-3\nfailure = "energy"'
    problem = problem_of(plate((10, 6), material=words, kinematics="finite"))
    assert "force_density" in problem.stepper().state()
    plain = problem_of(plate((10, 6), material=words.replace('"energy"', '"stretch"'), kinematics="finite"))
    assert "force_density" not in plain.stepper().state()


@pytest.mark.parametrize("failure", ["stretch", "energy"])
def test_resuming_at_any_step_changes_nothing(failure):
    """Nor does it where bonds are beyond their limit once others broke: they break in the next step."""
    strength = f'failure = "{failure}"\nenergy_release_rate = 2e-3\nmodel = "lps"\npoissons_ratio = 0.2'
    problem = problem_of(plate((10, 6), material=strength, kinematics="finite"))
    particles, bonds = problem.subdomain.particles, problem.subdomain.bonds
    particles.put(particles.velocity, 0.05 * np.random.default_rng(0).standard_normal((60, 2)))
    stepper = problem.stepper()
    for _ in range(30):
        stepper.advance()
        before = [np.copy(each) for each in (bonds.states(), particles.owned(particles.dissipated), particles.owned(particles.force_density))] + [stepper.broken]
        stepper.resume()
        after = [bonds.states(), particles.owned(particles.dissipated), particles.owned(particles.force_density), stepper.broken]
        assert all(np.array_equal(one, other) for one, other in zip(before, after))
    assert stepper.broken > 20
