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
    (get, *_), other = tip.state()["tip/tip"], CrackTip(comm, settings, members, view, dt=1.0)
    other.state()["tip/tip"][1](get())
    assert other.read(stepper) == tip.read(stepper) and other.record() == tip.record()
    assert tip.path_direction() == pytest.approx([1.0, 0.0])


@pytest.mark.parametrize("steps, path", [((), None), ((0,), None), ((0, 0, 1, 1, 1, 2, 3, 3), [1.0, 0.0]), ((7, 4, 5, 6), [1.0, 0.0]), ((10, 11, 10, 11), [0.6, 0.8])])
def test_the_direction_of_a_path(steps, path, comm):
    """Of places that lie on a line whatever their order and however long the tip stays, forward; two places that it jumps between give the line through both."""
    problem = problem_of(plate((4, 4)))
    tip = CrackTip(comm, SimpleNamespace(name="tip", direction=None, threshold=0.35, window=8.0), np.arange(16), View(problem.subdomain, problem.body.law), dt=1.0)
    places = [(float(k), 7.0) for k in range(10)] + [(4.0, 7.0), (1.0, 3.0)]
    for k in steps:
        tip._follow(places[k])
    assert tip.path_direction() == (path if path is None else pytest.approx(path, abs=1e-12))


def test_a_bent_path_has_the_direction_of_least_squared_distances(comm):
    """Places (0, 0), (2, 0), (2, 1), (4, 1): covariance [[2, 1/2], [1/2, 1/4]], whose larger eigenvalue is l = (9 + sqrt(65))/8 along (1/2, l - 2)."""
    problem = problem_of(plate((4, 4)))
    tip = CrackTip(comm, SimpleNamespace(name="tip", direction=[-1.0, 0.0], threshold=0.35, window=8.0), np.arange(16), View(problem.subdomain, problem.body.law), dt=1.0)
    for place in ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (2.0, 0.0), (2.0, 1.0), None, (4.0, 1.0)):  # it waits at the first: that counts once
        tip._follow(place)
    along = np.array([0.5, (9 + np.sqrt(65)) / 8 - 2])
    assert tip.path_direction() == pytest.approx(-along / np.linalg.norm(along), rel=1e-12)
