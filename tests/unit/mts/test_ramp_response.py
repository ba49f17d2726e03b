import numpy as np
import pytest

from pdhpc.mts.ramp_response import chord, fejer, largest_z, ramp_response, response_polynomials


@pytest.mark.parametrize("m", (1, 2, 5, 20))
def test_velocity_is_half_the_fejer_kernel(m):
    z = np.linspace(1e-3, 3.9, 20)
    theta = np.arccos(1 - z / (2 * m * m))
    assert fejer(m, z) == pytest.approx((np.sin(m * theta / 2) / (m * np.sin(theta / 2))) ** 2, abs=1e-12)


@pytest.mark.parametrize("m", (2, 5, 20))
def test_the_chord_lies_above_the_kernel(m):
    limit = largest_z(1.0, 1.0)
    assert limit == pytest.approx(4.08)
    z = np.linspace(0.0, limit, 100)
    assert np.all(1 - chord(m, limit) * z >= fejer(m, z) - 1e-12)


def test_polynomials_are_the_response_where_the_degree_suffices():
    z = np.linspace(0.0, 3.0, 7)
    for part, coefficients in zip(ramp_response(3, z), response_polynomials(3, 2, 3.0)):
        assert np.polynomial.polynomial.polyval(z, coefficients) == pytest.approx(part, abs=1e-12)
    lower = response_polynomials(10, 2, 3.0)
    assert [len(each) for each in lower] == [3, 3, 3] and [len(each) for each in response_polynomials(2, 2, 3.0)] == [2, 2, 2]
    assert np.polynomial.polynomial.polyval(z, lower[1]) == pytest.approx(ramp_response(10, z)[1], abs=0.02)
