import numpy as np
import pytest

from pdhpc.gfem import raster
from pdhpc.gfem.raster import rebuild


def test_a_linear_field_on_either_side_of_a_crack(pulled_plate, comm):
    """Moving least squares of degree 1 have it exactly, a thousandth of a spacing from the crack too; the upper half is moved up by 1."""
    _, stepper = pulled_plate(comm, "galerkin", everywhere=True)
    subdomain = stepper.local.subdomain
    slots = subdomain.particles.slots
    field = lambda x: np.stack([0.1 * x[:, 0], 0.2 * x[:, 1] + (x[:, 1] > 0.0)], axis=1)  # noqa: E731
    subdomain.particles.position[slots] = field(subdomain.places_at(slots))
    found = rebuild(comm, stepper)
    cut = found.position[:, 0] < -20.0  # well behind the tip at -16
    assert found.pixel == 1.0 / 8 and len(found.position) == 60 * 30 * 64
    assert found.displacement[cut] == pytest.approx(field(found.position[cut]), abs=1e-12)
    ahead = (found.position[:, 0] > 0.0) & (np.abs(found.position[:, 1]) < 0.5)
    assert np.abs(np.diff(found.displacement[ahead][:8, 1])).max() < 0.5  # where nothing is cut there is no jump


def test_functions_are_those_of_the_cells(pulled_plate, comm):
    parts, stepper = pulled_plate(comm, "pinned")
    found = rebuild(comm, stepper)
    at = np.einsum("pa,pad->pd", found.shape, parts.mesh.points[found.corner])
    assert at == pytest.approx(found.position, abs=1e-12) and 0 < len(at) == stepper.patches.enriched[: parts.mesh.n_owned_cells].sum() * 25 * 64


def test_many_particles_get_fewer_points(monkeypatch):
    assert [raster._fineness(n, 2) for n in (0, 400, 3125, 50_000, 10**7)] == [8, 8, 8, 2, 1]


def test_short_bonds_bear_a_smaller_weight(coupled_body, comm):
    """Bonds of up to 2.24 spacings: weights of radius 2 would take particles beyond them for cut off, and be refused."""
    problem = coupled_body(["particles.horizon=2.0"])
    stepper = problem.stepper()
    particles = stepper.local.subdomain.particles
    particles.position[particles.slots] = 0.01 * stepper.local.subdomain.places_at(particles.slots)
    found = rebuild(comm, stepper)
    assert np.isfinite(found.displacement).all()
