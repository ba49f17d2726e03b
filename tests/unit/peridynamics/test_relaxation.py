import math

import numpy as np
import pytest

from pdhpc.parallel.linear_solver import SolverError
from pdhpc.peridynamics.relaxation import EVERY
from pdhpc.peridynamics.tangent import Tangent
from pdhpc.study.verify.case import problem_of
from pdhpc.study.verify.static import still
from pdhpc.warm_up import MODELS, PATHS, NoGhosts
from tests.unit.peridynamics.test_equilibrium import PULL, RAMP

STRETCH = PULL.format(kind="displacement", value=0.1, more=RAMP)
BEND = PULL.format(kind="force_density", value=0.0, more="").replace("[0.0, 0.0]", "[0.0, 1e-5]")


def relaxation(extra, overrides=(), **options):
    return problem_of(still((14, 6), "relaxation", extra=extra, **options), list(overrides)).stepper()


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
def test_the_density_keeps_every_step_stable(model, path):
    """omega_max^2 of D^-1 K, by power iteration on the linear operator, lies below 4, and not far."""
    stepper = relaxation(STRETCH, [f"particles.path={path}"], model=model)
    stepper.prepare()
    tangent = Tangent(*stepper.whole, NoGhosts, stepper.sums, 1.0)
    w, value = np.random.default_rng(0).standard_normal(stepper.held.shape), 0.0
    for _ in range(300):
        tangent.apply(w, dict.fromkeys(("force", "exchange", "wait"), 0.0))
        image = -tangent.change / stepper.density[:, None]
        value = np.linalg.norm(image) / np.linalg.norm(w)
        w = image / np.linalg.norm(image)
    assert 2.0 < value < 4.0


def test_damping_is_critical_for_the_way_to_go():
    """At the end, w is the way gone and c = 2 sqrt(w . K w / w . D w) with K w the load: w . K w = w . V b."""
    problem = problem_of(still((14, 6), "relaxation", extra=BEND))
    stepper = problem.stepper()
    stepper.advance()
    stepper._keep(stepper._last)  # no change since then: the way gone decides
    u, load = stepper.view.field("displacement"), stepper.loads
    free = ~stepper.held
    expected = 2 * math.sqrt((u * load)[free].sum() / (stepper.density[:, None] * u * u)[free].sum())
    stepper._start[0][...], stepper._start[1][...] = np.where(free, load, 0.0), 0.0  # at rest with u = 0 loads are all there is
    assert stepper._damping() == pytest.approx(expected, rel=1e-6)


def test_supports_arrive_over_the_first_iterations():
    stepper = relaxation(STRETCH, ["static.iterations=20"])  # 14 particles long: 28 iterations to arrive
    with pytest.raises(SolverError):
        stepper.advance()
    end = stepper.view.field("displacement")[:, 0].max()
    assert end == pytest.approx(0.1 * 21 / 28)


def test_a_steady_path_is_continued_in_a_straight_line():
    stepper = relaxation(STRETCH, steps=4)
    stepper.advance()
    assert stepper.iterations > 2 * EVERY
    stepper.advance()
    assert stepper.iterations == 0, "linear: where the first increment leads is equilibrium"


def test_no_equilibrium_is_an_error_with_its_numbers():
    with pytest.raises(SolverError, match=r"load step 1 \(t = 1 s\) found no equilibrium: after 30 iterations forces are out of balance by .* of .* N, where static.tolerance = 1e-10"):
        relaxation(STRETCH, ["static.iterations=30"]).advance()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_numbers_that_are_not_finite_end_the_iteration():
    stepper = relaxation(STRETCH, kinematics="finite")
    stepper.prepare = lambda: stepper.density.fill(1e-6)  # far too light
    with pytest.raises(SolverError, match="out of balance by nan"):
        stepper.advance()
