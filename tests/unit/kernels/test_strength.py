"""Scatter of strengths: Weibull's distribution, from ids or places alone."""
import math

import numpy as np
import pytest

from pdhpc.kernels.strength import scatter_strengths
from pdhpc.materials.failure import ScatteredLimit

N = 200_000


def strengths(places, modulus=5.0, grain=0.0, seed=1, ids=None):
    """Return the factors of particles of one block, in slots the other way round."""
    n = len(places)
    scale = 1 / math.gamma(1 + 1 / modulus)
    limit = ScatteredLimit(np.ones((1, 1)), np.ones(2), np.array([modulus]), np.array([scale]), np.array([seed], np.uint64), np.array([grain]))
    found, slots = np.full(n, -1.0), np.arange(n, dtype=np.int32)[::-1].copy()
    scatter_strengths(np.arange(n) if ids is None else ids, places, slots, np.zeros(n, np.uint8), limit, found)
    return found[slots]


@pytest.mark.parametrize("modulus", [1.0, 5.0, 20.0])
def test_particles_follow_the_distribution(modulus):
    """The largest distance of a sample of n from its distribution exceeds 1.95/sqrt(n) once in a thousand times (Kolmogorov)."""
    found = np.sort(strengths(np.zeros((N, 2)), modulus))
    exact = 1 - np.exp(-((found * math.gamma(1 + 1 / modulus)) ** modulus))
    assert np.abs(exact - (np.arange(N) + 0.5) / N).max() < 1.95 / math.sqrt(N)
    deviation = math.sqrt(math.gamma(1 + 2 / modulus) / math.gamma(1 + 1 / modulus) ** 2 - 1)
    assert found.mean() == pytest.approx(1.0, abs=4 * deviation / math.sqrt(N)) and found.std() == pytest.approx(deviation, rel=0.02)


def test_neighbours_and_seeds_have_nothing_to_do_with_each_other():
    found, other = strengths(np.zeros((N, 2))), strengths(np.zeros((N, 2)), seed=2)
    for shift in (1, 2, 100, 128):
        assert abs(np.corrcoef(found[shift:], found[:-shift])[0, 1]) < 4 / math.sqrt(N)
        assert abs(np.corrcoef(found[shift:], other[:-shift])[0, 1]) < 4 / math.sqrt(N), "seeds do not shift ids"
    assert abs(np.corrcoef(found, other)[0, 1]) < 4 / math.sqrt(N)


def test_a_chain_is_as_strong_as_its_weakest_link():
    """The least of n is a Weibull variable of scale n^(-1/m) (Weibull 1951): so is its mean."""
    for n in (10, 100):
        least = strengths(np.zeros((N, 2)), 5.0).reshape(-1, n).min(axis=1)
        assert least.mean() == pytest.approx(n ** (-1 / 5), rel=4 * 0.229 / math.sqrt(N / n))


@pytest.mark.parametrize("dim", [2, 3])
def test_grains_are_cells_of_one_random_point_per_cube(dim):
    """Found again by looking at each pair: the nearest point of a grid large enough; here from the strengths alone, as all places of a grain share one."""
    size, random = 0.7, np.random.default_rng(2)
    places = random.uniform(-7.0, 7.0, (60_000, dim))
    found = strengths(places, grain=size)
    assert np.array_equal(found, strengths(places, grain=size, ids=random.permutation(60_000))), "places alone count"
    assert not np.array_equal(found, strengths(places, grain=size, seed=2))
    grains, number, counts = np.unique(found, return_inverse=True, return_counts=True)
    inner = 20**dim
    assert inner < len(grains) < (22**dim), "as many as cubes, and some around the box"
    middle = np.stack([np.bincount(number, places[:, axis]) for axis in range(dim)], axis=1) / counts[:, None]
    away = np.linalg.norm(places - middle[number], axis=1)
    assert away.max() < 1.6 * size, "a grain is in one piece, of about the size of a cube"
    whole = np.abs(middle).max(axis=1) < 6.3
    assert whole.sum() == pytest.approx(18**dim, rel=0.06)
    if dim == 2:
        assert counts[whole].std() > 0.2 * counts[whole].mean(), "of unequal size; squares would scatter by 1/sqrt(150) = 0.08"


def test_a_straight_line_meets_a_grain_once():
    """Voronoi cells are convex: along a line no strength comes back."""
    places = np.stack([np.linspace(-30.0, 30.0, 40_001), np.full(40_001, 0.3), np.full(40_001, -0.2)], axis=1)
    found = strengths(places, grain=1.0)
    pieces = found[np.concatenate([[True], np.diff(found) != 0])]
    assert 40 < len(pieces) < 130 and len(np.unique(pieces)) == len(pieces)


def test_an_infinite_modulus_is_no_scatter():
    limit = ScatteredLimit(np.ones((1, 1)), np.ones(2), np.array([np.inf]), np.ones(1), np.ones(1, np.uint64), np.zeros(1))
    found = np.zeros(3)
    scatter_strengths(np.arange(3), np.zeros((3, 2)), np.arange(3, dtype=np.int32), np.zeros(3, np.uint8), limit, found)
    assert (found == 1.0).all()
