"""Every case of `pdhpc verify` but the slow ones, and proof that a case can fail."""
import pytest

from pdhpc.study.verify import catalogue
from pdhpc.study.verify.case import CASES, Check


@pytest.mark.parametrize("name", [name for name, each in CASES.items() if not each.slow])
def test_case(name):
    checks = CASES[name].function()
    assert checks
    failures = [f"{check.what}: measured {check.measured!r}, expected {check.expected!r}" for check in checks if not check.passed]
    assert not failures, failures


def test_nan_and_wrong_numbers_fail():
    assert not Check("", float("nan"), 0.0, 1.0, "").passed
    assert not Check("", 1.02, 1.0, 0.01, "").passed
    assert Check("", 1.02, 1.0, 0.03, "").passed
    assert Check("", -0.9, 0.0, 1.0, "", relative=False).passed


def test_exit_code_tells_of_a_failure(monkeypatch, capsys):
    monkeypatch.setitem(CASES, "wrong", CASES["rigid_rotation"]._replace(name="wrong", function=lambda: [Check("two is three", 2.0, 3.0, 1e-3, "nobody")]))
    assert catalogue.main(["wrong"], False) == 1
    assert "FAIL" in capsys.readouterr().out
