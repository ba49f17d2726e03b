import numpy as np
import pytest


def test_momentum_of_whole_particles_and_of_blended_ones(pulled_plate, comm):
    """Both ways to say what the points get agree where alpha is 1 around: I1 + dt b = rho (V - v^n), I2 + dt^2/2 b = rho (U - u^n - dt v^n)."""
    parts, stepper = pulled_plate(comm, "galerkin")
    parts.local.law.break_at[...] = np.inf
    for _ in range(3):
        stepper.advance()
    stepper.choose_patches()
    stepper.seed_particles()
    stepper.run_particles()
    stepper.reconstruct()
    state, points, mesh = stepper.scheme.state, parts.local.points, parts.mesh
    assert np.abs(state.increment).max() > 0.01
    right = np.zeros((len(mesh.points), 2))
    state.gather_displacement_momentum(stepper.dt, mesh.cells, right)
    blended = state._point
    alone = np.abs(state.momentum - points.mass[:, None] * state.increment)
    whole = np.setdiff1d(np.arange(len(points.slots)), blended)
    assert len(blended) > 0 and (len(whole) == 0 or alone[whole].max() == 0.0)
    alpha = parts.local.alpha[points.slots[blended]]
    assert np.all(alpha == 1.0), "alpha is 1 on enriched cells"
    inner = blended[alone[blended].max(axis=1) < 1e-14]
    assert 0 < len(inner) < len(blended), "only within a bond of the ramp blended forces are less than whole ones"
    assert np.sum(right) == pytest.approx(np.sum(state.momentum) + outside(parts, parts.local.blended.moment), rel=1e-12)


def outside(parts, sums):
    """Return the sum over lanes of owned particles that are not in enriched cells."""
    blended = parts.local.blended
    lanes = (blended.cell >= 0) & ~blended.inside
    return parts.local.volume * sums.transpose(0, 2, 1).reshape(-1, 2)[lanes].sum()


def test_forces_of_a_uniform_strain(pulled_plate, comm):
    """With alpha = 1 within their reach, particles away from the body's edges and the crack are in equilibrium; at free edges they are not."""
    parts, stepper = pulled_plate(comm, "galerkin", everywhere=True)
    state, points, mesh = stepper.scheme.state, parts.local.points, parts.mesh
    cell = np.repeat(points.cell, np.diff(points.start))
    place = np.einsum("pa,pad->pd", points.shape, mesh.points[mesh.cells[cell]])
    state.put(1e-3 * place, None)
    parts.local.evaluate()
    right = np.zeros((len(mesh.points), 2))
    state.gather_forces(mesh.cells, right)
    inner = (np.abs(place) < [26.0, 11.0]).all(axis=1) & ((place[:, 0] > -9.0) | (np.abs(place[:, 1]) > 4.0))
    assert inner.sum() > 100 and np.abs(state.momentum[inner]).max() < 1e-15 < 1e-5 < np.abs(state.momentum).max()
    assert np.abs(right.sum(axis=0)).max() < 1e-14
