"""The scene runs/double_notch_tension.toml at twice the spacing."""
import pytest

from pdhpc.study.verify.case import CASES
from pdhpc.study.verify.shipped import peak_by_fracture_mechanics


def test_the_load_rises_straight_and_drops_to_nothing():
    """The peak lies above that of fracture mechanics, here with a horizon of a quarter of the notch's depth, by no more than a half."""
    assert peak_by_fracture_mechanics() == pytest.approx(326, abs=1)
    for check in CASES["double_notch_tension"].function():
        assert check.passed, check
