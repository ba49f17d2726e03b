import numpy as np
import pytest

from pdhpc.mts.two_regions import Timer
from pdhpc.study.verify.mts import coupled, shake


@pytest.mark.parametrize("interface", ("polynomial", "kick"))
def test_a_run_continues_from_its_state(interface):
    """What state() names is all that the future depends on: a copy of it, put back, gives the same run again."""
    problem = coupled(4, interface, kinematics="finite", material="critical_stretch = 0.01")
    shake(problem, 2e-3)
    stepper = problem.stepper()
    for _ in range(10):
        stepper.advance()
    saved = {key: np.copy(get()) for key, (get, put, *_) in stepper.state().items()}
    assert {"step", "multiplier/coarse", "multiplier/fine", "coarse/displacement", "fine/bonds", "fine/force_density"} <= set(saved)
    for _ in range(10):
        stepper.advance()
    expected = stepper.view.field("displacement").copy()
    moving = stepper.view.field("velocity").copy()
    for key, (get, put, *_) in stepper.state().items():
        put(saved[key])
    assert stepper.step == 10 and ("kick/offset" in saved) == (interface == "kick")
    for _ in range(10):
        stepper.advance()
    assert np.array_equal(stepper.view.field("displacement"), expected) and np.array_equal(stepper.view.field("velocity"), moving)


def test_energies_of_both_regions_are_the_bodys():
    problem = coupled(4, "polynomial")
    shake(problem, 1e-3)
    stepper = problem.stepper()
    undivided = sum(float((part.subdomain.particles.mass_share[part.subdomain.particles.slots]).sum()) for part in problem.parts)
    assert undivided == pytest.approx(24 * 16)
    kinetic = stepper.ledger()["kinetic_energy"].sum()
    velocity, mass = stepper.view.field("velocity"), 1.0
    assert kinetic == pytest.approx(0.5 * mass * (velocity**2).sum())


def test_timer():
    account = {"a": 0.0}
    with Timer(account, "a"):
        pass
    assert 0 < account["a"] < 1
