import numpy as np
import pytest

from pdhpc.gfem import moments as integrals
from pdhpc.gfem.enriched_cells import EnrichedCells
from pdhpc.gfem.patch_projection import PatchProjection, set_means, set_norms


def project(case, eta):
    """Return (mean, norm, residual of the vertices in J) of a field at the points."""
    points, pair = case.points, integrals.pairs(4)
    cells = EnrichedCells(case.mesh, points)
    masses, moments = np.empty((cells.n_owned, 10)), np.empty((cells.n_owned, integrals.width_of_field(4, 2)))
    integrals.mass_moments(points.start, points.shape, points.mass, masses)
    integrals.field_moments(points.start, points.shape, points.mass, eta, moments)
    mean, norm = np.zeros((len(case.mesh.points), 2)), np.zeros((len(case.mesh.points), 2))
    set_means(cells.stars, pair, masses, moments, mean)
    set_norms(cells.stars, pair, masses, moments, mean, norm)
    rows = np.flatnonzero(case.inside[cells.stars.vertex])
    return mean, norm, PatchProjection(cells.stars, pair, masses, rows).residuals(moments, mean)


def test_mean_and_norm_are_the_sums(comm, cracked_box):
    case = cracked_box(comm)
    mean, norm, _ = project(case, case.eta)
    vertex = np.flatnonzero(case.inside)[3]
    hat = (case.points.shape * (case.mesh.cells[np.repeat(case.points.cell, 16)] == vertex)).sum(axis=1)
    weight = case.points.mass * hat
    expected = weight @ case.eta / weight.sum()
    assert mean[vertex] == pytest.approx(expected, rel=1e-12)
    assert norm[vertex] == pytest.approx(np.sqrt(case.points.mass @ (hat[:, None] * (case.eta - expected)) ** 2), rel=1e-12)


def test_standard_functions_leave_nothing_and_a_jump_does(comm, cracked_box):
    """1 + x - y + x y is in the span of each patch; a jump of 2 through its middle, which they can only smear, leaves more than a third."""
    case = cracked_box(comm)
    x, y = case.position.T
    *_, residual = project(case, np.stack([1.0 + x - y + x * y, 1e6 + np.sign(y - 2.0)], axis=1))
    centre = case.mesh.points[case.inside, 1] == 2.0
    assert residual[:, 0].max() < 1e-7 and centre.any() and residual[centre, 1].min() > 0.35
    assert residual[~centre, 1].max() < 0.36  # a jump along the patch's own lines of vertices is no different from one at its rim


def test_patch_of_a_single_point_leaves_nothing(comm, cracked_box):
    """With fewer points than functions anything is a standard function: pivots that vanish are left out."""
    case = cracked_box(comm, ratio=1)
    *_, residual = project(case, np.random.default_rng(1).normal(size=case.eta.shape))
    assert np.isfinite(residual).all() and residual.max() < 1e-7
