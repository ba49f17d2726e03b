"""Polynomials, the pivot rule, and how far bonds must reach."""
import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.mls.basis import PIVOT_OF_DIAGONAL, Basis, factorise, polynomials, size_of, solve


@kernel
def _polynomials(x, y, z, third, degree, p):
    polynomials(x, y, z, third, degree, p)


@kernel
def _factorise(a):
    return factorise(a)


@kernel
def _solve(a, n, b):
    solve(a, n, b)


@kernel
def _size_of(dim, degree):
    return size_of(dim, degree)


@pytest.mark.parametrize("dim, degree, size", [(2, 0, 1), (2, 1, 3), (2, 2, 6), (3, 0, 1), (3, 1, 4), (3, 2, 10)])
def test_the_polynomials_of_a_degree(dim, degree, size):
    """All products of up to `degree` of x, y, z, each once; the constant first, then x, y, z."""
    assert Basis(dim, degree).size == _size_of(dim, degree) == size
    x, y, z = 2.0, 3.0, 5.0  # primes: products tell the factors
    p = np.full(size, np.nan)
    _polynomials(x, y, z, None if dim == 2 else 2, degree, p)
    axes = (x, y, z)[:dim]
    products = [1.0] + [a for a in axes if degree > 0] + [a * b for n, a in enumerate(axes) for b in axes[n:] if degree > 1]
    assert p[: 1 + dim * (degree > 0)].tolist() == products[: 1 + dim * (degree > 0)]
    assert sorted(p.tolist()) == sorted(products)


def normal_equations(n, seed=0):
    p = np.random.default_rng(seed).standard_normal((40, n))
    p[:, 0] = 1.0
    return p.T @ p


@pytest.mark.parametrize("n", (1, 3, 4, 6, 10))
def test_the_solution_is_that_of_numpy(n):
    a, b = normal_equations(n), np.random.default_rng(1).standard_normal((n, 2))
    expected, work = np.linalg.solve(a, b), b.copy()
    assert _factorise(a) == n
    _solve(a, n, work)
    assert np.allclose(work, expected, rtol=1e-12)


def test_leading_rows_solve_the_equations_of_a_lower_degree():
    whole, b = normal_equations(6), np.arange(12.0).reshape(6, 2)
    a, work = whole.copy(), b.copy()
    _factorise(a)
    _solve(a, 3, work)
    assert np.allclose(work[:3], np.linalg.solve(whole[:3, :3], b[:3]), rtol=1e-12)


@pytest.mark.parametrize("share, pivots", [(0.5, 2), (2.0, 3)])
def test_a_pivot_that_keeps_too_little_of_its_diagonal_ends_the_factors(share, pivots):
    """Columns 1, e, e + s f, orthonormal e and f of 100 entries: the last pivot is s^2, its diagonal 1 + s^2."""
    s = np.sqrt(share * PIVOT_OF_DIAGONAL)
    gram = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0 + s * s]])
    assert _factorise(gram) == pivots


@pytest.mark.parametrize("share, pivots", [(4e-5, 1), (6e-5, 2)])
def test_a_pivot_that_is_small_against_the_weights_ends_the_factors(share, pivots):
    """5e-5 is the least: particles within 1/140 of a spacing of a line do not tell a slope across it."""
    assert _factorise(np.diag([7.0, share * 7.0])) == pivots


def test_undefined_equations_have_no_pivot():
    assert _factorise(np.full((3, 3), np.nan)) == 0
    assert _factorise(np.zeros((3, 3))) == 0


@pytest.mark.parametrize("dim, half", [(2, 0.71), (3, 0.87)])
def test_bonds_reach_as_far_as_weights(dim, half):
    Basis(dim).check_reach(0.1, (2.0 + half) * 0.1)
    Basis(dim, radius=1.5).check_reach(0.1, (1.5 + half) * 0.1)
    with pytest.raises(ValueError, match=rf"\(2 \+ {half}\) spacings = {(2 + half) / 10:g} m, but they end at 0.26 m \(2.6 spacings\)"):
        Basis(dim).check_reach(0.1, 0.26)
    with pytest.raises(ValueError):
        Basis(dim).check_reach(0.1, (2.0 + half) * 0.1 * 0.999)


@pytest.mark.parametrize("words", [(1,), (4,), (2, 3), (2, -1), (2, 1, 0.0), (2, 1, float("nan"))])
def test_a_basis_that_is_none(words):
    with pytest.raises(ValueError, match="degree 0, 1 or 2"):
        Basis(*words)
