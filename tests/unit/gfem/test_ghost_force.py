"""Forces under uniform strain: none by elements alone nor by particles alone, small on a ramp, large on a step."""
import numpy as np
import pytest

from pdhpc.gfem.ghost_force import ghost_force
from pdhpc.gfem.local_particles import LocalParticles

STRAINS = ((1.0, 1.0, 0.0), (1.0, -0.3, 0.0), (0.0, 0.0, 1.0))


def found(stepper, strain=STRAINS[0]):
    return ghost_force(stepper.local, stepper.solution, strain)


@pytest.mark.parametrize("strain", STRAINS)
def test_one_model_has_none(coupled_body, strain):
    plain, particles = coupled_body(cells=(32, 32), tip=None).stepper(), coupled_body(("gfem.everywhere=true",), cells=(32, 32), tip=None).stepper()
    assert found(plain, strain) < 1e-13 and found(particles, strain) < 1e-13


@pytest.mark.parametrize("strain", STRAINS)
def test_a_ramp_has_little_and_a_step_much(coupled_body, strain, monkeypatch):
    ramp = found(coupled_body(cells=(32, 32)).stepper(), strain)
    set_alpha = LocalParticles._set_alpha

    def step_alpha(self, cells, weight):
        set_alpha(self, cells, weight)
        self.alpha[:] = self.alpha > 0.0

    monkeypatch.setattr(LocalParticles, "_set_alpha", step_alpha)
    stepper = coupled_body(cells=(32, 32)).stepper()
    by_ramp = stepper.solution.material.stiffness.reshape(-1, 16, 8, 8)
    by_ramp[:, 1:] = 0.0  # elements act where no corner is in J
    step = found(stepper, strain)
    assert 1e-4 < ramp < 0.05 and step > 3 * ramp, "the step lies at edges of cells, where slopes of hats jump"


def test_it_is_the_same_whatever_state_the_body_is_in(coupled_body, shake):
    """Broken bonds count as whole, and looking changes nothing."""
    stepper = coupled_body(("time.dt=1.2", "time.end=12.0"), material="critical_stretch = 0.02").stepper()
    before = found(stepper)
    shake(stepper, 0.05)
    for _ in range(2):
        stepper.advance()
    assert stepper.broken > 0
    state = {key: np.copy(get()) for key, (get, *_) in stepper.state().items()}
    force = stepper.solution.force.copy()
    assert stepper.ghost_force() == found(stepper)
    stepper.solution.evaluate(stepper.time)
    assert np.array_equal(stepper.solution.force, force) and all(np.array_equal(get(), state[key]) for key, (get, *_) in stepper.state().items())
    if not np.array_equal(stepper.patches.chosen, coupled_body().stepper().patches.chosen):
        return  # patches grew: another ramp
    assert found(stepper) == pytest.approx(before, rel=1e-12)
