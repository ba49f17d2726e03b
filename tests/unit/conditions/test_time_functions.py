import numpy as np
import pytest

from pdhpc.conditions.time_functions import Constant, Ramp, Sine, Table

FUNCTIONS = [Constant(), Ramp(1.0, 3.0), Sine(0.7, 0.3), Table((0.0, 1.0, 4.0), (2.0, -1.0, 5.0))]


def test_values():
    assert [Ramp(1.0, 3.0).value(t) for t in (0.0, 1.0, 2.0, 3.0, 9.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]
    assert Sine(0.25).value(1.0) == pytest.approx(1.0)
    table = FUNCTIONS[3]
    assert [table.value(t) for t in (-1.0, 0.5, 2.5, 9.0)] == [2.0, 0.5, 2.0, 5.0]
    assert Constant().value(3.0) == 1.0


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_rates_are_derivatives(function):
    for t in (0.4, 1.7, 2.9, 5.5):
        assert function.rate(t) == pytest.approx((function.value(t + 1e-6) - function.value(t - 1e-6)) / 2e-6, abs=1e-5)


def test_rates_outside_are_zero():
    assert Ramp(1.0, 3.0).rate(0.5) == 0.0 and Ramp(1.0, 3.0).rate(3.5) == 0.0
    assert Table((0.0, 1.0), (0.0, 1.0)).rate(-0.5) == 0.0 and Table((0.0, 1.0), (0.0, 1.0)).rate(1.0) == 0.0
    assert np.isclose(Table((0.0, 1.0), (0.0, 1.0)).rate(0.0), 1.0)
