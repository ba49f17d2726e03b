import numpy as np
import pytest

from pdhpc.mts.energy import conserved_energy, inertia_of
from pdhpc.mts.strip import LinearForces
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.case import plate, problem_of


def test_conserved_energy_of_an_undivided_body_does_not_change():
    """Verlet conserves 1/2 a'(M - dt^2/4 K) a + 1/2 v'K v of linear forces exactly."""
    problem = problem_of(plate((10, 6)))
    particles = problem.subdomain.particles
    particles.put(particles.velocity, 1e-3 * noise(particles.id, 2))
    stepper = problem.stepper()
    forces = LinearForces(problem.subdomain, problem.body.law, problem.exchange.bind)
    first = conserved_energy(stepper, forces).sum()
    for _ in range(200):
        stepper.advance()
    assert first > 0 and conserved_energy(stepper, forces).sum() == pytest.approx(first, rel=1e-12)


def test_inertia_counts_the_share_of_the_mass():
    problem = problem_of(plate((4, 4)))
    particles, field = problem.subdomain.particles, np.ones((16, 2))
    stepper = problem.stepper()
    assert inertia_of(stepper, field).sum() == pytest.approx(16.0)
    particles.mass_share = np.full(len(particles.position), 0.25)
    assert inertia_of(stepper, field).sum() == pytest.approx(4.0)
