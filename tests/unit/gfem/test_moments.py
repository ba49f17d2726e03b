import numpy as np
import pytest

from pdhpc.gfem import moments as integrals


def test_pairs_are_the_upper_triangle():
    assert integrals.pairs(3).tolist() == [[0, 1, 2], [1, 3, 4], [2, 4, 5]]


@pytest.fixture
def fields(comm, cracked_box):
    """Return (case, pair, masses, moments)."""
    case = cracked_box(comm)
    points, pair = case.points, integrals.pairs(4)
    masses, moments = np.empty((len(points.cell), 10)), np.empty((len(points.cell), integrals.width_of_field(4, 2)))
    integrals.mass_moments(points.start, points.shape, points.mass, masses)
    integrals.field_moments(points.start, points.shape, points.mass, case.eta, moments)
    return case, pair, masses, moments


def test_moments_are_the_sums(fields):
    case, pair, masses, moments = fields
    points, c = case.points, 3
    at = slice(points.start[c], points.start[c + 1])
    N, m, e = points.shape[at], points.mass[at], case.eta[at]
    mean = m @ e / m.sum()
    assert masses[c, pair] == pytest.approx(N.T @ (m[:, None] * N), rel=1e-13)
    for d in range(2):
        of_field = moments[c, 21 * d : 21 * d + 21]
        assert of_field[0] == pytest.approx(mean[d], rel=1e-13)
        assert of_field[1:11][pair] == pytest.approx(N.T @ ((m * (e[:, d] - mean[d]))[:, None] * N), abs=1e-15)
        assert of_field[11:][pair] == pytest.approx(N.T @ ((m * (e[:, d] - mean[d]) ** 2)[:, None] * N), abs=1e-15)


def test_sums_over_cells(fields):
    case, pair, masses, moments = fields
    mass = integrals.cell_masses(pair, masses)
    assert mass.sum() == pytest.approx(case.points.mass.sum(), rel=1e-13)
    assert integrals.squares(mass, pair, moments).sum() == pytest.approx((case.points.mass @ case.eta**2).sum(), rel=1e-12)


def test_tested_momentum_is_adjoint_to_the_field(fields):
    """sum_p q . x = sum_i nodes_i . (sum_p q phi_i) + amplitude_i . tested_i for every q."""
    case, _, _, moments = fields
    points, mesh = case.points, case.mesh
    corners = np.ascontiguousarray(mesh.cells[points.cell])
    at_points = points.start, points.shape, case.eta, moments
    mean, nodes, amplitude = np.sin(mesh.points), np.cos(mesh.points), np.exp(-mesh.points)
    momentum, tested, field = case.position**2, np.zeros_like(mean), np.empty_like(case.eta)
    integrals.add_tested_momentum(corners, at_points, momentum, mean, tested)
    integrals.field_at_points(corners, at_points, mean, nodes, amplitude, field)
    nodal = np.zeros_like(nodes)
    np.add.at(nodal, mesh.cells[np.repeat(points.cell, 16)], points.shape[:, :, None] * momentum[:, None])
    assert np.sum(momentum * field) == pytest.approx(np.sum(nodes * nodal) + np.sum(amplitude * tested), rel=1e-13)


def test_energy_is_lost_in_whole_patches_only(fields):
    """Velocity 3 projected to 1, mass m: 4 m in each component, in the cells all of whose vertices are inside."""
    case, *_ = fields
    corners, points = np.ascontiguousarray(case.mesh.cells[case.points.cell]), case.points
    whole = np.repeat(case.inside[corners].all(axis=1), 16)
    momentum = 3.0 * points.mass[:, None] * np.ones(2)
    lost = integrals.lost_energy(corners, points.start, points.mass, momentum, np.ones_like(momentum), case.inside)
    assert 0 < whole.sum() < len(whole) and lost == pytest.approx(2 * 4.0 * points.mass[whole].sum(), rel=1e-13)
