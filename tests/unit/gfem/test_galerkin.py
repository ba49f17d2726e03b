import numpy as np
import pytest


def end_of(pulled_plate, comm, scheme, steps=12, **options):
    """Return (u of particles in enriched cells by slot, u of vertices, stepper) after some steps."""
    parts, stepper = pulled_plate(comm, scheme, **options)
    for _ in range(steps):
        stepper.advance()
    assert stepper.failure is None
    return parts.local.subdomain.particles.position.copy(), parts.solution.displacement.copy(), stepper


def test_everything_enriched_is_the_local_run(pulled_plate, comm):
    """Particles everywhere and tolerance 0: the space holds U and V, so the projections change nothing, through fracture."""
    pinned, _, reference = end_of(pulled_plate, comm, "pinned", everywhere=True)
    found, _, stepper = end_of(pulled_plate, comm, "galerkin", tolerance=0.0, everywhere=True)
    assert reference.broken > 0 and stepper.broken == reference.broken
    assert found == pytest.approx(pinned, abs=1e-12 * np.abs(pinned).max())
    assert abs(stepper.scheme.lost) < 1e-12 * stepper.ledger()["kinetic_energy"].sum()


def test_few_functions_are_close_to_all(pulled_plate, comm):
    """Tolerance 0.02 leaves functions out and is as near to particles everywhere as "pinned" is; without any function the crack cannot open: control."""
    exact, _, _ = end_of(pulled_plate, comm, "pinned", everywhere=True)
    error = {}
    for scheme, tolerance in (("pinned", 0.0), ("galerkin", 0.02), ("galerkin", 1e9)):
        *_, stepper = end_of(pulled_plate, comm, scheme, tolerance=tolerance)
        stepper.view.prepare()
        slots = stepper.local.subdomain.particles.slots
        error[tolerance] = np.linalg.norm((stepper.local.subdomain.particles.position - exact)[slots]) / np.linalg.norm(exact[slots])
        if scheme == "galerkin":
            assert (stepper.scheme.enriched[0] < stepper.patches.chosen.sum()).all() and 1.0 <= stepper.scheme.mass.condition() < 1e3
    assert error[0.02] < 1.2 * error[0.0] < 0.05 and error[1e9] > 3 * error[0.02]


def test_rigid_velocity_is_kept(pulled_plate, comm):
    """Without loads a uniform velocity moves everything alike: its coefficients are those of the standard functions."""
    parts, stepper = pulled_plate(comm, "galerkin")
    parts.local.loads.clear()
    parts.solution.loads.clear()
    parts.local.acting.clear()
    parts.local.acting_on_lanes.clear()
    parts.solution.velocity[...] = [1.0, -2.0]
    parts.local.subdomain.particles.velocity[parts.local.points.slots] = [1.0, -2.0]
    stepper.scheme.settle()
    parts.solution.evaluate(0.0)
    for _ in range(3):
        stepper.advance()
    assert parts.solution.displacement == pytest.approx(np.tile([9.0, -18.0], (len(parts.mesh.points), 1)), rel=1e-12)
    assert stepper.scheme.state.displacement == pytest.approx(np.tile([9.0, -18.0], (len(parts.local.points.slots), 1)), rel=1e-12)
    assert stepper.broken == 0 and abs(stepper.scheme.lost) < 1e-9
