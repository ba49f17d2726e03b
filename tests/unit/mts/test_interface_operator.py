import numpy as np
import pytest

from pdhpc.study.verify.mts import coupled, dense, noise, shake


@pytest.fixture(scope="module")
def problem():
    return coupled(5, "exact", (16, 10), 2.0)


def test_h_takes_the_gap_out(problem):
    """A ramp of multipliers to x = H^-1 r closes a velocity gap r, in linear kinematics."""
    shake(problem, 1e-3)
    stepper = problem.stepper()
    stepper.free_pass()
    gap = stepper.velocity_gap()
    assert np.abs(gap).max() > 1e-6
    stepper.link_pass(stepper.solve(gap))
    assert np.abs(stepper.interface.velocity_gap()).max() < 1e-8 * np.abs(gap).max()


def test_with_one_step_h_is_the_diagonal(comm):
    stepper = coupled(1, "exact", (16, 10), 2.0).stepper()
    h = dense(comm, stepper.operator.apply, stepper.operator.diagonal.shape)
    assert h == pytest.approx(np.diag(stepper.operator.diagonal.ravel()), abs=1e-15 * h.max())


def test_costs_of_the_three(problem):
    regions = problem.regions
    stepper = problem.stepper()
    x = noise(np.arange(len(stepper.interface.fine.slots)), 2)
    costs = {}
    for kind in ("exact", "polynomial", "kick"):
        operator = regions.operator(stepper.interface, problem.dt, kind)
        operator.solve(x)
        operator.respond(x)
        costs[kind] = operator.bond_evaluations
    assert costs["kick"] == 0 < costs["polynomial"] < 0.2 * costs["exact"]


def test_held_components_do_not_respond(comm):
    extra = '[[region]]\nname = "mid"\nshape = "box"\nlower = [-9.0, -6.0]\nupper = [9.0, 0.0]\n[[load]]\ntype = "velocity"\nregion = "mid"\nvalue = [0.0, "free"]\n'
    problem = coupled(4, "polynomial", (16, 10), 2.0, extra=extra)
    shake(problem, 1e-3)
    stepper = problem.stepper()
    for _ in range(50):
        stepper.advance()
    for part in problem.parts:
        held = part.subdomain.places()[:, 1] <= 0
        particles = part.subdomain.particles
        assert np.all(particles.owned(particles.displacement)[held, 0] == 0) and np.abs(particles.owned(particles.displacement)[~held, 0]).max() > 0
