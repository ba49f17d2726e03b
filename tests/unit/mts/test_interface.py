import numpy as np
import pytest

from pdhpc.study.verify.mts import coupled, shake


def test_multipliers_give_both_copies_one_acceleration():
    problem = coupled(2)
    for part in problem.parts:
        particles = part.subdomain.particles
        particles.put(particles.displacement, 0.01 * part.subdomain.places() ** 2)
    stepper = problem.stepper()
    interface = stepper.interface
    found = [copies.subdomain.particles.force_density[copies.slots] for copies in (interface.coarse, interface.fine)]
    assert np.abs(interface.fine.multiplier).max() > 0
    assert interface.to_fine(found[0]) == pytest.approx(found[1], abs=1e-14 * np.abs(found[1]).max())


def test_values_travel_to_the_other_copies():
    stepper = coupled(2).stepper()
    interface = stepper.interface
    places = [copies.subdomain.places_at(copies.slots) for copies in (interface.coarse, interface.fine)]
    assert interface.to_fine(places[0]) == pytest.approx(places[1], abs=0) and interface.to_coarse(places[1]) == pytest.approx(places[0], abs=0)


def test_gaps_and_work_of_the_multipliers():
    problem = coupled(4)
    shake(problem, 1e-3)
    stepper = problem.stepper()
    for _ in range(20):
        stepper.advance()
    gap, elongation = stepper.interface.largest_gap()
    assert 0 < gap < elongation
    assert stepper.interface.work != 0.0
    assert np.abs(stepper.interface.velocity_gap()).max() < 1e-10
