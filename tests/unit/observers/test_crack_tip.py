from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.observers.crack_tip import CrackTip
from pdhpc.peridynamics.view import View
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


@pytest.mark.parametrize("path", PATHS)
def test_position_and_speed_of_a_crack_that_runs_at_a_known_speed(path, comm, lose_bonds):
    problem = problem_of(plate((40, 7)), [f"particles.path={path}"])
    subdomain, members = problem.subdomain, np.arange(280)
    x = subdomain.places()
    settings = SimpleNamespace(name="tip", direction=[2.0, 0.0], threshold=0.35, window=8.0)
    view = View(subdomain, problem.body.law)
    tip = CrackTip(comm, settings, members, view, dt=1.0)
    assert tip.every == 2 and tip.columns == ("tip.x [m]", "tip.y [m]", "tip.speed [m/s]")
    stepper = SimpleNamespace(view=view, step=0)
    tip.start(stepper)
    assert np.isnan(tip.read(stepper)[0]) and tip.speed == 0.0
    for step in range(2, 31, 2):  # one particle of the middle row, a spacing further, every second step: speed 1/2
        row = np.flatnonzero((x[:, 1] == 0.0) & (x[:, 0] == step / 2 - 19.5))[0]
        lose_bonds(subdomain, row)
        tip.observe(stepper)
    assert tip.position == (-4.5, 0.0)
    assert tip.speed == pytest.approx(0.5) and tip.largest_speed == pytest.approx(0.5)
    (get, _), other = tip.state()["tip/tip"], CrackTip(comm, settings, members, view, dt=1.0)
    other.state()["tip/tip"][1](get())
    assert other.read(stepper) == tip.read(stepper)
