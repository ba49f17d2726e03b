import numpy as np
import pytest

from pdhpc.mts.strip import LinearForces, critical_step
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.mts import coupled
from pdhpc.warm_up import MODELS


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("kinematics", ("linear", "finite"))
def test_linear_forces_are_those_of_small_displacements(model, kinematics):
    material = "" if model == "pmb" else 'model = "lps"\npoissons_ratio = 0.2'
    problem = problem_of(plate((12, 8), kinematics=kinematics, material=material))
    particles, size = problem.subdomain.particles, 1e-7
    u = size * noise(particles.id, 2)
    forces = LinearForces(problem.subdomain, problem.body.law, problem.exchange.bind)
    forces.w[particles.slots, :2] = u
    rows = forces.all_rows()
    forces.apply(rows, rows)
    particles.put(particles.displacement, u)
    problem.stepper()
    expected = particles.owned(particles.force_density)
    assert particles.owned(forces.force_density) == pytest.approx(expected, abs=(1e-12 if kinematics == "linear" else 1e-5) * np.abs(expected).max())


def test_power_iteration_finds_the_largest_frequency():
    problem = problem_of(plate((8, 6)))
    particles = problem.subdomain.particles
    forces = LinearForces(problem.subdomain, problem.body.law, problem.exchange.bind)
    rows, matrix = forces.all_rows(), np.empty((96, 96))
    for column in range(96):
        forces.w[particles.slots, :2] = np.eye(96)[column].reshape(48, 2)
        forces.apply(rows, rows)
        matrix[:, column] = -forces.force_density[particles.slots].ravel()
    exact = 2 / np.sqrt(np.linalg.eigvals(matrix).real.max())
    found = critical_step(problem.subdomain, problem.body.law, forces, lambda values: values)
    assert exact * (1 - 1e-12) <= found < 1.01 * exact and problem.critical_dt < exact




def test_levels_grow_by_what_is_bonded():
    stepper = coupled(4, "polynomial", (44, 36), 11.0).stepper()
    strip = stepper.operator.strip
    assert np.array_equal(np.sort(stepper.interface.fine.slots), strip.slots[0])
    for level in range(2):
        inner, outer = (stepper.fine.subdomain.places_at(strip.slots[each]) for each in (level, level + 1))
        apart = np.linalg.norm(outer[:, None] - inner[None], axis=2).min(axis=1)
        assert len(outer) > len(inner) and apart.max() < 3.5
