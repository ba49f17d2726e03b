"""Reconstructed values and gradients against the formulas in dense matrices, and what happens where there is little or nothing to see."""
import itertools

import numpy as np
import pytest

from pdhpc.mls.basis import Basis
from pdhpc.mls.reconstruct import MovingLeastSquares, empty_reconstruction
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.mls_reference import BOX, body_of, by_slot, dense_squares, polynomial, random_points, rebuild, squares_of

CRACK = {
    2: '[[crack]]\ntype = "polyline"\npoints = [[-100.0, -3.2], [1.3, 0.4]]\n',
    3: '[[crack]]\ntype = "rectangle"\ncorner = [-100.0, -20.0, -100.0]\nedge1 = [101.0, 20.3, 0.0]\nedge2 = [0.0, 0.0, 200.0]\n',
}
CHOICES = list(itertools.product(("lattice", "cloud"), (2, 3)))


def wave(x):
    return np.sin(0.3 * np.cumsum(x, axis=1)) + (x[:, 1:2] > 0.0)


@pytest.mark.parametrize("path, dim", CHOICES)
def test_fits_are_those_of_dense_matrices(path, dim):
    problem = body_of(dim, path, spacing=0.5, extra=CRACK[dim])
    points = random_points(problem, 400)
    found = rebuild(problem, wave, points)
    value, gradient = dense_squares(problem, wave, points, "voronoi")
    assert (found.degree == 1).all()
    assert np.abs(found.value - value).max() < 1e-11 and np.abs(found.gradient - gradient).max() < 1e-10
    plain = dense_squares(problem, wave, points, "none")[0]
    assert np.abs(plain - value).max() > 0.1, "the crack matters"


@pytest.mark.parametrize("path, dim", CHOICES)
@pytest.mark.parametrize("degree", (0, 1, 2))
def test_fields_are_continuous_where_nothing_is_broken(path, dim, degree):
    """From the cell of one particle to that of the next the weights are the same, as long as bonds reach as far as weights."""
    problem = body_of(dim, path)
    points = random_points(problem, 300)
    points = points[(np.abs(points) < np.array(BOX[dim]) / 2 - 1).all(axis=1)]
    points[:, 0] = np.round(points[:, 0])  # faces between cells: particles lie at half numbers, or at whole ones
    points[:, 0] += 0.0 if BOX[dim][0] % 2 == 0 else 0.5
    step = np.eye(dim)[0] * 1e-8
    left, right = (rebuild(problem, wave, points + sign * step, degree) for sign in (-1, 1))
    assert np.array_equal(left.degree, right.degree)
    assert np.abs(left.value - right.value).max() < 1e-6 and np.abs(left.gradient - right.gradient).max() < 1e-6


@pytest.mark.parametrize("path, dim", CHOICES)
def test_particles_that_are_not_valid_are_not_used(path, dim):
    """Half of the particles hold nothing: fields come from the others, and where there is none there is no field."""
    problem = body_of(dim, path)
    squares, subdomain = squares_of(problem), problem.subdomain
    field, gradient = polynomial(dim, 1)
    places = subdomain.places()
    right = places[:, 0] > 0.0
    values = by_slot(subdomain, np.where(right[:, None], field(places), np.nan))
    valid = np.zeros(len(values), bool)
    subdomain.particles.put(valid, right)
    points = random_points(problem, 2000)
    found = squares.reconstruct(points, squares.nearest(points), values, valid)
    fitted = found.degree == 1
    assert fitted[points[:, 0] > 0.0].all()
    assert np.abs(found.value - field(points))[fitted].max() < 1e-10 and np.abs(found.gradient - gradient(points))[fitted].max() < 1e-9
    assert (found.degree[points[:, 0] < -2.0] == -1).all() and (found.value[found.degree < 0] == 0.0).all() and (found.gradient[found.degree < 0] == 0.0).all()
    assert np.isfinite(found.value).all()


@pytest.mark.parametrize("path, dim", CHOICES)
def test_a_particle_alone_and_a_row_of_particles(path, dim):
    """One particle gives a constant, a row of particles too: it does not bear a slope across itself."""
    for cells in ((1,) * dim, (5,) + (1,) * (dim - 1)):
        problem = body_of(dim, path, cells)
        points = random_points(problem, 50)
        found = rebuild(problem, lambda x: np.full((len(x), 1), 3.0), points, 2)
        assert (found.degree == 0).all() and np.allclose(found.value, 3.0, rtol=1e-14) and (found.gradient == 0.0).all()


@pytest.mark.parametrize("path, dim", CHOICES)
def test_degree_follows_what_the_particles_bear(path, dim):
    """A layer one particle thick bears no slope across, two layers a slope but no curvature."""
    for layers, degree in ((1, 0), (2, 1), (4, 2)):
        problem = body_of(dim, path, (9,) * (dim - 1) + (layers,))
        found = rebuild(problem, wave if layers > 1 else np.sin, np.zeros((1, dim)) + 0.2, 2, 2.0)
        assert found.degree.tolist() == [degree]


def test_results_go_where_they_are_told_and_points_of_nobody_hold_nothing():
    problem = body_of(2)
    squares, values = squares_of(problem), by_slot(problem.subdomain, problem.subdomain.places())
    points = np.array([[0.3, 0.2], [500.0, 0.0]])
    result = empty_reconstruction(2, 2, 2)
    for array in result:
        array[:] = 7
    assert squares.reconstruct(points, squares.nearest(points), values, None, result) is result
    assert np.allclose(result.value, [[0.3, 0.2], [0.0, 0.0]], atol=1e-13)
    assert np.allclose(result.gradient, [np.eye(2), np.zeros((2, 2))], atol=1e-13)
    assert result.degree.tolist() == [1, -1]


def test_bonds_are_seen_as_they_are_at_the_time(lose_bonds):
    problem = body_of(2)
    squares, values = squares_of(problem), by_slot(problem.subdomain, problem.subdomain.places())
    row = 100
    point = problem.subdomain.places()[row : row + 1] + 0.1
    near = squares.nearest(point)
    assert squares.reconstruct(point, near, values).degree.tolist() == [1]
    lose_bonds(problem.subdomain, row)
    found = squares.reconstruct(point, near, values)
    assert found.degree.tolist() == [0] and np.allclose(found.value, point - 0.1)


def test_a_horizon_too_small_is_refused():
    problem = problem_of(plate((6, 6), 2.0))
    with pytest.raises(ValueError, match="larger horizon"):
        MovingLeastSquares(problem.subdomain, 1.0, 2.5, Basis(2))  # horizon 2 and half a spacing of the volume correction; (2 + 0.71) are needed
