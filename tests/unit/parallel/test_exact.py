import math

import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.parallel.exact import ExactSums, add_exactly


@kernel
def add_all(values, places):
    for n in range(len(values)):
        add_exactly(places, values[n])


def total(comm, values):
    sums = ExactSums(comm, 1)
    add_all(np.array(values, float), sums.places[0])
    return sums.totals()[0]


def test_sums_are_those_of_exact_arithmetic_in_any_order(comm):
    random = np.random.default_rng(1)
    values = random.standard_normal(5000) * 10.0 ** random.uniform(-30, 30, 5000)
    values = np.concatenate([values, -values[:2500], [1.0, 2.0**-53, 2.0**-54]])
    expected = math.fsum(values)  # exact, rounded once
    for _ in range(3):
        random.shuffle(values)
        assert total(comm, values) == expected


@pytest.mark.parametrize("values, expected", [([], 0.0), ([0.0, -0.0], 0.0), ([1e90, 1.0, -1e90], 1.0), ([2.0**-310], 2.0**-310), ([2.0**-330], 0.0), ([-3.5, 1.25], -2.25)])
def test_single_values_and_the_ends_of_the_grid(comm, values, expected):
    assert total(comm, values) == expected


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e200])
def test_what_does_not_fit_is_not_a_number(comm, bad):
    assert math.isnan(total(comm, [1.0, bad]))


def test_sums_start_again(comm):
    sums = ExactSums(comm, 2)
    add_all(np.array([1.5]), sums.places[1])
    assert sums.totals() == [0.0, 1.5]
    sums.clear()
    assert sums.totals() == [0.0, 0.0]
