import math

import numpy as np
import pytest
from scipy.integrate import quad

from pdhpc.materials.influence import CODES, FORMULAS, largest_first_moment, moment, value

OMEGA = {"constant": lambda t: 1.0, "inverse_distance": lambda t: 1 / t, "gaussian": lambda t: math.exp(-t * t), "conical": lambda t: 1 - t}


@pytest.mark.parametrize("name", list(CODES))
@pytest.mark.parametrize("power", [2, 3, 4])
def test_moments_are_the_integrals(name, power):
    horizon = 0.7
    expected = quad(lambda r: OMEGA[name](r / horizon) * r**power, 0, horizon)[0]
    assert moment(name, power, horizon) == pytest.approx(expected, rel=1e-10)


def test_every_influence_has_its_formula():
    assert set(FORMULAS) == set(CODES)


@pytest.mark.parametrize("name", list(CODES))
def test_no_bond_within_reach_exceeds_the_largest_first_moment(name):
    horizon, reach = 0.7, 0.8
    r = np.linspace(1e-4, reach, 4001)
    largest = (value(name, r, horizon) * r).max()
    assert largest == pytest.approx(largest_first_moment(name, horizon, reach), rel=1e-6)
    assert largest <= largest_first_moment(name, horizon, reach) * (1 + 1e-12)


def test_the_conical_influence_ends_at_the_horizon():
    assert np.array_equal(value("conical", np.array([0.0, 0.35, 0.7, 0.75]), 0.7), [1.0, 0.5, 0.0, 0.0])
