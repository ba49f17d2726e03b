import math

import pytest
from scipy.integrate import quad

from pdhpc.materials.influence import CODES, FORMULAS, moment

OMEGA = {"constant": lambda t: 1.0, "inverse_distance": lambda t: 1 / t, "gaussian": lambda t: math.exp(-t * t)}


@pytest.mark.parametrize("name", list(CODES))
@pytest.mark.parametrize("power", [2, 3, 4])
def test_moments_are_the_integrals(name, power):
    horizon = 0.7
    expected = quad(lambda r: OMEGA[name](r / horizon) * r**power, 0, horizon)[0]
    assert moment(name, power, horizon) == pytest.approx(expected, rel=1e-10)


def test_every_influence_has_its_formula():
    assert set(FORMULAS) == set(CODES)
