import pytest

from pdhpc.study.verify.case import plate, problem_of

FINE = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 4.0\nstep_ratio = 2\n'


def test_what_a_body_says_of_itself(comm):
    problem = problem_of(plate((4, 4), 2.0))
    stepper = problem.stepper()
    most = 14  # one beside the corner reaches up to 2.5 spacings: all others but the one in the opposite corner
    assert problem.sizes(stepper, comm) == {"particles": 16, "bonds": problem.subdomain.bonds.n_directed // 2, "path": problem.body.path, "neighbours_largest": most}
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
    assert problem.sizes(stepper, comm)["particles"] == 384
