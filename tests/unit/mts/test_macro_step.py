import numpy as np

from pdhpc.study.verify.mts import coupled, shake


def test_the_regions_take_turns_in_one_order():
    """The coarse sweep goes on in m pieces, one before each sub-step."""
    problem = coupled(3, "kick")
    stepper, log = problem.stepper(), []
    pieces, advance = stepper.coarse.advance_in, stepper.fine.advance

    def logged(count):
        for _ in pieces(count):
            log.append("coarse")
            yield

    stepper.coarse.advance_in = logged
    stepper.fine.advance = lambda: log.append("fine") or advance()
    stepper.advance()
    assert log == ["coarse", "fine"] * 3
    assert stepper.step == 1 and stepper.coarse.step == 1 and stepper.fine.step == 3
    assert np.isclose(stepper.coarse.time, stepper.fine.time) and stepper.time == stepper.dt


def test_evaluations_are_counted_by_region():
    problem = coupled(3, "polynomial")
    stepper = problem.stepper()
    before = stepper.bond_evaluations
    stepper.advance()
    spent = {name: count - before[name] for name, count in stepper.bond_evaluations.items()}
    bonds = [part.subdomain.bonds.n_directed for part in problem.parts]
    assert (spent["coarse"], spent["fine"]) == (bonds[0], 3 * bonds[1]) and spent["interface"] > 0


def test_a_solve_that_fails_is_told():
    problem = coupled(3, "exact")
    shake(problem, 1e-3)
    stepper = problem.stepper()
    particles = stepper.fine.subdomain.particles
    particles.velocity[particles.slots[0]] = np.nan
    assert stepper.operator.failure is None
    for _ in range(3):
        stepper.advance()
    assert "interface_ did not converge" in stepper.operator.failure
