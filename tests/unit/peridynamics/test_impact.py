import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS

BALL = """
[[impactor]]
name = "ball"
shape = "cylinder"
center = [0.2, 8.2]
radius = 4.0
velocity = [0.05, -0.2]
friction = 0.3
{more}
"""


def struck(path="cloud", more="mass = 20.0", material="", dt=0.3):
    problem = problem_of(plate((16, 8), kinematics="finite", material=material, extra=BALL.format(more=more)), [f"particles.path={path}"])
    problem.dt = dt
    return problem.stepper()


def impact_of(stepper):
    return stepper.conditions.interactions[0]


@pytest.mark.parametrize("path", PATHS)
def test_momentum_goes_over_exactly_and_the_energy_balance_closes(path):
    left = []
    for halving in (1, 2):
        stepper = struck(path, dt=0.3 / halving)
        particles, impactor = stepper.subdomain.particles, impact_of(stepper).impactor
        start, before = 20.0 * impactor.velocity.copy(), _total(stepper)
        change = 0.0
        for _ in range(80 * halving):
            stepper.advance()
            change = max(change, abs(_total(stepper) / before - 1))
        momentum = 20.0 * impactor.velocity + particles.owned(particles.velocity).sum(axis=0)  # particles of mass 1
        assert np.abs(momentum - start).max() < 1e-13 * np.abs(start).max() * 20
        assert np.linalg.norm(20.0 * impactor.velocity - start) > 0.5 and stepper.ledger()["contact_loss"].sum() > 1e-3
        left.append(change)
    assert left[0] < 1e-2 and left[1] < 0.4 * left[0]


def _total(stepper):
    ledger = {name: values.sum() for name, values in stepper.ledger().items()}
    return sum(ledger.values()) - 2 * ledger["external_work"]


def test_a_prescribed_impactor_works_on_the_body():
    left = []
    for halving in (1, 2):
        stepper = struck(more='time = { function = "ramp", start = 0.0, end = 5.0 }', dt=0.3 / halving)
        for _ in range(50 * halving):
            stepper.advance()
        ledger = {name: values.sum() for name, values in stepper.ledger().items()}
        assert ledger["external_work"] > 0.1 and ledger["impactor_energy"] == 0.0
        assert impact_of(stepper).bytes_sent == 0
        left.append(abs(_total(stepper)) / ledger["external_work"])
    assert left[0] < 1e-2 and left[1] < 0.4 * left[0]


def test_the_reaction_is_minus_the_forces_on_the_body():
    stepper = struck()
    for _ in range(30):
        stepper.advance()
    impact = impact_of(stepper)
    assert np.abs(impact.forces()).max() > 0
    assert impact.impactor.force == pytest.approx(-impact.forces().sum(axis=0), rel=1e-12)
    particles = stepper.subdomain.particles
    assert np.abs(particles.owned(particles.force_density).sum(axis=0) + impact.impactor.force).max() < 1e-12, "bonds add up to nothing, V = 1"


def test_a_run_goes_on_from_its_state_to_the_last_bit():
    one, other = struck(material="critical_stretch = 0.02"), struck(material="critical_stretch = 0.02")
    for _ in range(30):
        one.advance()
    for key, (getter, *_) in one.state().items():
        value = getter()
        other.state()[key][1](np.array(value) if isinstance(value, np.ndarray) else value)
    other.subdomain.particles.place()
    other.internal.evaluate()
    other._add_loads()
    for _ in range(40):
        one.advance()
        other.advance()
    assert one.broken > 10
    for name in ("displacement", "velocity", "force_density"):
        assert np.array_equal(one.subdomain.particles.owned(getattr(one.subdomain.particles, name)), other.subdomain.particles.owned(getattr(other.subdomain.particles, name)))
    assert np.array_equal(impact_of(one).impactor.velocity, impact_of(other).impactor.velocity)
    assert np.array_equal(impact_of(one).loss, impact_of(other).loss)


def test_an_impactor_too_light_for_the_step_is_reported():
    stepper = struck(more="mass = 0.005")
    for _ in range(40):
        stepper.advance()
    assert "impactor 'ball': its mass" in impact_of(stepper).warnings()[-1]
    assert impact_of(struck()).warnings() == []
