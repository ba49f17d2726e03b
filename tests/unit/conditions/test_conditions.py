import numpy as np
import pytest

from pdhpc.conditions.conditions import Conditions
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
    saved = {key: np.copy(get()) for key, (get, put) in problem.conditions.state().items()}
    assert {"work/0", "work/1", "initial_kinetic/0"} == set(saved)
    stepper.advance()
    for key, (get, put) in problem.conditions.state().items():
        put(saved[key])
        assert np.array_equal(get(), saved[key])


def test_nothing_acts_without_conditions():
    problem = problem_of(plate((4, 4)))
    assert Conditions(problem.subdomain.particles, problem.body.law.density).external_work().size == 0
