import math

import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


def largest_frequency(problem):
    """Largest frequency of the assembled bonds by power iteration on M^-1 K, forces as the program computes them."""
    particles, stepper = problem.subdomain.particles, problem.stepper()
    density = problem.body.law.density[particles.owned(particles.block)]
    u = np.random.default_rng(0).standard_normal((particles.n_owned, particles.dim))
    value = 0.0
    for _ in range(400):
        u /= np.linalg.norm(u)
        particles.put(particles.displacement, u)
        particles.place()
        stepper.internal.evaluate()
        u = -particles.owned(particles.force_density) / density[:, None]
        value = np.linalg.norm(u)
    return math.sqrt(value)


STIFF_PART = """
[[material]]
name = "stiff"
density = 0.5
youngs_modulus = 7.0
[[body]]
name = "inlay"
material = "stiff"
shape = "box"
lower = [{x}, -6.0]
upper = [{y}, 6.0]
"""


@pytest.mark.parametrize("text", [
    plate((20, 12)),
    plate((20, 12), 4.0),
    plate((8, 8, 8), dimension="3d"),
    plate((20, 1), 2.0),
    plate((20, 12), extra=STIFF_PART.format(x=10.0, y=16.0)),
], ids=["2D", "wide horizon", "3D", "chain", "two materials"])
@pytest.mark.parametrize("path", PATHS)
def test_the_bound_is_below_the_true_critical_step_and_near_it(text, path):
    problem = problem_of(text, [f"particles.path={path}"])
    true = 2.0 / largest_frequency(problem)
    assert 0.6 * true < problem.critical_dt <= true * (1 + 1e-3)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("nu, lowest", [(0.0, 0.6), (1 / 3, 0.6), (0.45, 0.4)])
def test_the_bound_holds_for_linear_solids_too(path, nu, lowest):
    """Above the Poisson's ratio of central forces the bound takes all energy of dilatation as if it came on top: it is pessimistic there."""
    problem = problem_of(plate((16, 12)), [f"particles.path={path}", "material.solid.model=lps", f"material.solid.poissons_ratio={nu}"])
    true = 2.0 / largest_frequency(problem)
    assert lowest * true < problem.critical_dt <= true * (1 + 1e-3)


def test_cracks_do_not_lower_the_step():
    cracked = problem_of(plate((20, 12), extra='[[crack]]\ntype = "polyline"\npoints = [[-20.0, 0.0], [20.0, 0.0]]'))
    assert cracked.critical_dt >= problem_of(plate((20, 12))).critical_dt


@pytest.mark.parametrize("factor, grows", [(0.99, False), (1.02, True)])
def test_verlet_is_stable_below_the_true_critical_step_only(factor, grows):
    problem = problem_of(plate((12, 8)))
    problem.dt = factor * 2.0 / largest_frequency(problem)
    particles = problem.subdomain.particles
    particles.put(particles.displacement, 1e-6 * np.random.default_rng(0).standard_normal((particles.n_owned, particles.dim)))
    particles.velocity[:] = 0.0
    stepper = problem.stepper()
    for _ in range(300):
        stepper.advance()
    assert (np.abs(particles.displacement).max() > 1.0) == grows
