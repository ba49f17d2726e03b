import itertools
import math

import numpy as np
import pytest

from pdhpc.fem.elements import ELEMENTS

KINDS = [kind for kind in ELEMENTS if kind != "line"]
VOLUME = {"line": 1.0, "quad": 1.0, "hexahedron": 1.0, "triangle": 0.5, "tetra": 1 / 6}


def points_of(element, seed=0):
    """Points inside: means of the corners with random weights."""
    return np.random.default_rng(seed).dirichlet(np.ones(element.corners), 7) @ element.places


@pytest.mark.parametrize("kind", ELEMENTS)
def test_shape_functions_are_one_at_their_corner_and_hold_linear_functions(kind):
    element = ELEMENTS[kind]
    assert np.array_equal(element.shape(element.places), np.eye(element.corners))
    xi = points_of(element)
    assert np.allclose(element.shape(xi).sum(axis=1), 1.0, atol=1e-15)
    assert np.allclose(element.shape(xi) @ element.places, xi, atol=1e-15)
    assert np.allclose(np.einsum("nci,cj->nij", element.gradient(xi), element.places), np.eye(element.dim), atol=1e-15)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_gradients_are_differences(kind):
    element, h = ELEMENTS[kind], 1e-5
    xi = points_of(element)
    for axis, step in enumerate(h * np.eye(element.dim)):
        assert np.allclose((element.shape(xi + step) - element.shape(xi - step)) / (2 * h), element.gradient(xi)[:, :, axis], atol=1e-10)


def monomial_integral(element, powers):
    """Closed form: 1/(p+1) by axis, on simplices prod p! / (sum p + dim)!."""
    if not element.simplex:
        return math.prod(1 / (p + 1) for p in powers)
    return math.prod(math.factorial(p) for p in powers) / math.factorial(sum(powers) + element.dim)


@pytest.mark.parametrize("kind", ELEMENTS)
@pytest.mark.parametrize("n", (2, 3, 4))
def test_quadrature_is_exact_to_its_degree(kind, n):
    element = ELEMENTS[kind]
    points, weights = element.quadrature(n)
    degree = 2 * n - element.dim if element.simplex else 2 * n - 1
    for powers in itertools.product(range(degree + 1), repeat=element.dim):
        if element.simplex and sum(powers) > degree:
            continue
        assert weights @ np.prod(points ** np.array(powers), axis=1) == pytest.approx(monomial_integral(element, powers), rel=1e-13)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_gauss_integrates_products_of_shape_functions(kind):
    element = ELEMENTS[kind]
    points, weights = element.gauss
    assert weights.sum() == pytest.approx(VOLUME[kind])
    for powers in itertools.product(range(3), repeat=element.dim):
        if sum(powers) <= 2 or not element.simplex:
            assert weights @ np.prod(points ** np.array(powers), axis=1) == pytest.approx(monomial_integral(element, powers), rel=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_facets_look_outward_and_close_the_cell(kind):
    """Normals point away from the centre, and the integral of x . n over the surface is dim times the volume (Gauss)."""
    element = ELEMENTS[kind]
    total = 0.0
    for facet in element.facets:
        x = element.places[facet]
        if element.dim == 2:
            along = x[1] - x[0]
            normal = np.array([along[1], -along[0]])
        else:
            normal = np.cross(x[1] - x[0], x[2] - x[0]) * (0.5 if len(x) == 3 else 1.0)
        assert normal @ (x.mean(axis=0) - element.places.mean(axis=0)) > 0
        total += normal @ x.mean(axis=0)
        assert len(facet) == ELEMENTS[element.facet].corners
    assert total == pytest.approx(element.dim * VOLUME[kind])
