"""The mass of standard functions that fade out, against sums over particles in numpy."""
import numpy as np
import pytest

from pdhpc.gfem.ramp_mass import RampMass


def dense(stepper):
    """Return (1 - alpha of the particles in enriched cells, functions there, their mass matrix), M = N^T (1 - alpha) rho V N."""
    local, mesh = stepper.local, stepper.solution.mesh
    points = local.points
    cell = np.repeat(points.cell, np.diff(points.start))
    hats = np.zeros((len(points.slots), len(mesh.points)))
    hats[np.arange(len(hats))[:, None], mesh.cells[cell]] = points.shape
    faded = 1.0 - local.alpha[points.slots]
    return faded, hats, hats.T @ (hats * (faded * points.mass)[:, None])


@pytest.fixture
def parts(coupled_body):
    stepper = coupled_body(["particles.thickness=0.5"]).stepper()
    return stepper, stepper.scheme.mass, *dense(stepper)


def test_mass_is_lumped_by_row_sums(parts):
    stepper, mass, _, _, matrix = parts
    outside = stepper.solution.outside_mass
    assert mass.lumped == pytest.approx(matrix.sum(axis=1) + outside, abs=1e-13) and mass.lumped.sum() > outside.sum() + 1.0
    assert np.array_equal(mass.acting, matrix.sum(axis=1) + outside > 1e-12) and 0 < np.sum(~mass.acting) < stepper.patches.chosen.sum()
    values = np.linalg.eigvalsh(np.diag(matrix.sum(axis=1)) - matrix)
    assert values.min() > -1e-12, "lumped mass is never less than the consistent one: what divides by it damps"


def test_the_consistent_mass_is_taken_out(parts):
    stepper, mass, _, _, matrix = parts
    velocity, right = np.random.default_rng(3).uniform(-1, 1, (2, *stepper.solution.velocity.shape))
    expected = right - 0.3 * matrix @ velocity
    mass.take_out(0.3, velocity, right)
    assert right == pytest.approx(expected, abs=1e-13)


def test_what_does_not_act_gets_nothing(parts):
    stepper, mass, _, _, _ = parts
    velocity, right = np.random.default_rng(4).uniform(-1, 1, (2, *stepper.solution.velocity.shape))
    change = np.full_like(right, np.nan)
    mass.divide(0.5, velocity, right, change)
    acting = mass.acting
    assert change[acting] == pytest.approx((0.5 * velocity + right / np.maximum(mass.lumped, 1e-30)[:, None])[acting]) and np.all(change[~acting] == 0.0)


def test_functions_fade_out_at_the_particles(parts):
    stepper, mass, faded, hats, _ = parts
    nodal = np.random.default_rng(5).uniform(-1, 1, stepper.solution.velocity.shape)
    field = np.zeros_like(stepper.local.subdomain.particles.position)
    mass.add_to_points(nodal, field)
    slots = stepper.local.points.slots
    assert field[slots] == pytest.approx(faded[:, None] * (hats @ nodal), abs=1e-14)
    field[slots] = 0.0
    assert not field.any(), "particles of the ramp alone"


def test_without_patches_it_is_that_of_elements(coupled_body):
    stepper = coupled_body(tip=None).stepper()
    mass = RampMass(stepper.solution.mesh)
    mass.follow(stepper.local, stepper.solution.outside_mass)
    assert len(mass.cells) == 0 and np.array_equal(mass.lumped, stepper.solution.outside_mass) and mass.acting.all() and mass.condition() == 1.0
