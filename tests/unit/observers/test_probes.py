import numpy as np
import pytest

from pdhpc.observers.probes import Probe, components, nearest_point
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


def test_component_names():
    assert components("damage", 2) == ["damage"]
    assert components("velocity", 3) == ["velocity_x", "velocity_y", "velocity_z"]
    assert components("stress", 2) == ["stress_xx", "stress_yy", "stress_xy"]
    assert components("strain", 3) == ["strain_xx", "strain_yy", "strain_zz", "strain_xy", "strain_xz", "strain_yz"]


@pytest.mark.parametrize("path", PATHS)
def test_means_and_points(path, comm):
    problem = problem_of(plate((6, 4), kinematics="linear"), [f"particles.path={path}"])
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, x @ np.array([[0.1, 0.0], [0.0, -0.2]]))
    stepper = problem.stepper()
    right = np.flatnonzero(x[:, 0] > 0)
    assert Probe(comm, "p", "displacement", right, 2).read(stepper) == pytest.approx([0.1 * 1.5, 0.0])
    assert Probe(comm, "p", "strain", right, 2).read(stepper) == pytest.approx([0.1, -0.2, 0.0])
    assert Probe(comm, "p", "strain", right, 2).columns == ("p.strain_xx [1]", "p.strain_yy [1]", "p.strain_xy [1]")
    near = nearest_point(comm, stepper.view, [2.4, 1.6])
    assert x[near].tolist() == [[2.5, 1.5]]


@pytest.mark.parametrize("path", PATHS)
def test_reaction_balances_the_internal_force(path, comm):
    problem = problem_of(plate((8, 4), kinematics="linear"), [f"particles.path={path}"])
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, x * [0.01, 0.0])
    stepper = problem.stepper()
    left, right = np.flatnonzero(x[:, 0] < 0), np.flatnonzero(x[:, 0] > 0)
    pull = Probe(comm, "right", "reaction", right, 2).read(stepper)
    hold = Probe(comm, "left", "reaction", left, 2).read(stepper)
    assert pull[0] > 0 and pull[0] == pytest.approx(-hold[0]) and pull[0] == pytest.approx(-particles.owned(particles.force_density)[right, 0].sum())
