from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.conditions.conditions import ParticleConditions
from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.conditions.time_functions import Constant
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS

PUSH = """
[[region]]
name = "left"
shape = "box"
lower = [-5.0, -2.0]
upper = [-3.0, 2.0]
[[load]]
type = "velocity"
region = "left"
value = [0.01, "free"]
time = {{ function = "{function}" {more} }}
[[load]]
type = "gravity"
value = [0.0, -1e-4]
"""


@pytest.mark.parametrize("function, more", [("constant", ""), ("sine", ", frequency = 0.05"), ("ramp", ", start = 1.0, end = 4.0")])
@pytest.mark.parametrize("path", PATHS)
def test_work_of_motions_and_loads_closes_the_balance(function, more, path):
    """The change of kinetic and strain energy is the external work, up to dt^2: halving the step quarters what is left."""
    left = []
    for halving in (1, 2):
        problem = problem_of(plate((10, 4), extra=PUSH.format(function=function, more=more)), [f"particles.path={path}"])
        problem.dt = 0.4 * problem.critical_dt / halving
        stepper = problem.stepper()
        start = sum(stepper.ledger()[name].sum() for name in ("kinetic_energy", "strain_energy"))
        for _ in range(40 * halving):
            stepper.advance()
        ledger = {name: values.sum() for name, values in stepper.ledger().items()}
        left.append(abs(ledger["kinetic_energy"] + ledger["strain_energy"] - start - ledger["external_work"]))
    assert left[0] < 0.02 * ledger["kinetic_energy"]
    assert left[1] < 0.4 * left[0]


def test_state_holds_the_accounts():
    problem = problem_of(plate((10, 4), extra=PUSH.format(function="constant", more="")))
    stepper = problem.stepper()
    stepper.advance()
    saved = {key: np.copy(get()) for key, (get, put, *_) in problem.conditions.state().items()}
    assert {"work/0", "work/1", "initial_kinetic/0"} == set(saved)
    stepper.advance()
    for key, (get, put, *_) in problem.conditions.state().items():
        put(saved[key])
        assert np.array_equal(get(), saved[key])


def test_work_is_that_of_each_particles_volume_or_of_its_copys_share():
    """A load on two particles of 2 and 3 m^3, of which a second copy holds a quarter and none; a motion of the first."""
    particles = SimpleNamespace(block=np.zeros(2, int), volume=np.array([2.0, 3.0]), mass_share=None, displacement=np.zeros((2, 2)), velocity=np.ones((2, 2)),
                                force_density=np.zeros((2, 2)))
    load, motion = BodyForce([0, 1], [[5.0, 0.0]] * 2, Constant()), PrescribedMotion([0], [1], [1.0], Constant(), "velocity")
    conditions = ParticleConditions(particles, np.array([4.0]), [load], [motion])
    conditions.add_loads(0.0)
    particles.force_density[0, 1] = -7.0
    conditions.work_of_old_forces(0.1)
    conditions.work_of_new_forces(0.1, 0.1)
    work = np.array([5.0 * 0.1 * 2.0, 5.0 * 0.1 * 3.0, (7.0 * 0.1 + 0.5 * 4.0) * 2.0])  # (power) (dt) (volume), and kinetic energy since it began at 0
    assert np.allclose(conditions.external_work(), work)
    particles.mass_share = np.array([0.75, 1.0])
    assert np.allclose(conditions.external_work(), work * [0.75, 1.0, 0.75])


def test_nothing_acts_without_conditions():
    problem = problem_of(plate((4, 4)))
    assert ParticleConditions(problem.subdomain.particles, problem.body.law.density).external_work().size == 0


@pytest.mark.parametrize("path", PATHS)
def test_prescribed_displacements_are_placed_and_known(path):
    text = plate((10, 4), extra=PUSH.format(function="ramp", more=", end = 4.0").replace("velocity", "displacement"))
    problem = problem_of(text, [f"particles.path={path}"])
    conditions, particles = problem.conditions, problem.subdomain.particles
    left, held = problem.subdomain.places()[:, 0] < -3.0, conditions.held()
    assert np.array_equal(held[:, 0], left) and not held[:, 1].any()
    particles.put(particles.displacement, np.full((40, 2), 0.5))
    conditions.place(2.0, 0.25)  # value 0.01, half of it at t = 2
    u = particles.owned(particles.displacement)
    assert u[left, 0] == pytest.approx(0.5 + 0.25 * (0.005 - 0.5)) and np.all(u[~left] == 0.5) and np.all(u[:, 1] == 0.5)
    conditions.place(2.0)
    assert np.all(particles.owned(particles.displacement)[left, 0] == 0.005)
