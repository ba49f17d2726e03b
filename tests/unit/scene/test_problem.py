import math

import pytest

from pdhpc.study.verify.case import plate, problem_of

FINE = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 4.0\nstep_ratio = 2\n'


def test_what_a_body_says_of_itself(comm):
    problem = problem_of(plate((4, 4), 2.0))
    stepper = problem.stepper()
    most = 14  # one beside the corner reaches up to 2.5 spacings: all others but the one in the opposite corner
    assert problem.sizes(stepper, comm) == {
        "particles": 16, "bonds": problem.subdomain.bonds.n_directed // 2, "path": problem.body.path, "neighbours_largest": most,
        "bodies": [{"name": "body", "particles": 16, "volume": 16.0, "mass": 16.0, "drawn_volume": 16.0}],
        "materials": [{"name": "solid", "density": 1.0, "horizon": 2.0, "critical_stretch": None}],
    }
    stepper.advance()
    work = problem.work(stepper, comm, 0.5)
    assert work["particle_steps_per_second_and_core"] == 32.0 and work["ghosts"] == 0 and work["bond_imbalance"] == 1.0
    assert work["bond_evaluations"] == sum(stepper.bond_evaluations.values()) and problem.work(stepper, comm, 0.0)["particle_steps_per_second_and_core"] is None
    assert problem.coupling(stepper, comm) is None and problem.guards(stepper, comm, []) == [] and problem.coupled(stepper, comm, None) is None


def test_what_two_regions_say(comm):
    problem = problem_of(plate((24, 16), extra=FINE))
    stepper = problem.stepper()
    coupled = problem.coupled(stepper, comm, problem.coupling(stepper, comm))
    assert coupled["step_ratio"] == 2 and coupled["regions"]["coarse"]["dt"] == pytest.approx(2 * coupled["regions"]["fine"]["dt"]) and len(problem.guards(stepper, comm, [])) == 1
    assert problem.sizes(stepper, comm)["particles"] == 384 == problem.sizes(stepper, comm)["bodies"][0]["particles"], "those of the overlap once"


def test_what_contact_and_impactors_say(comm):
    """A plane in touch with the body, moved 0.25 into it at once: four particles of V = 1 and s = E/h^2 = 1 push it back with 1."""
    extra = '[contact]\n[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, -2.0]\nnormal = [0.0, 1.0]\n'
    problem = problem_of(plate((4, 4), 2.0, kinematics="finite", material="critical_stretch = 0.5", extra=extra))
    problem.subdomain.particles.displacement[:, 1] -= 0.25
    stepper = problem.stepper()
    work = problem.work(stepper, comm, 1.0)
    assert work["contact"]["distance"] == 1.35 and work["contact"]["stiffness"] == {"solid": pytest.approx(15 * 9 / (math.pi * 8))}
    assert work["impactors"] == [{"name": "p", "position": [0.0, -2.0], "velocity": [0.0, 0.0], "force": [0.0, -1.0], "stiffness": {"solid": 1.0}}]
    assert problem.sizes(stepper, comm)["materials"][0]["critical_stretch"] == 0.5
