from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.observers.guard import FiniteGuard
from pdhpc.peridynamics.view import View
from pdhpc.run import RunError
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


@pytest.mark.parametrize("path", PATHS)
def test_nan_stops_the_run_and_names_the_particle(path, comm):
    problem = problem_of(plate((4, 4)), [f"particles.path={path}"])
    stepper = SimpleNamespace(view=View(problem.subdomain, problem.body.law), step=7, time=0.7)
    guard = FiniteGuard(comm, [3])
    guard.observe(stepper)
    particles = problem.subdomain.particles
    particles.displacement[particles.slots[5], 1] = np.inf
    with pytest.raises(RunError, match=r"particle 5 at \(-0.5, -0.5\) m is not finite at step 7"):
        guard.observe(stepper)
    with pytest.raises(RunError):
        guard.finish(stepper)
