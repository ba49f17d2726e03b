import math
from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.parallel import comm as module
from pdhpc.parallel.comm import Sums, agree_on_error, await_turn, exact_sum, exact_sums, on_root


def test_exact_sum_agrees_with_fsum_in_any_order(comm):
    random = np.random.default_rng(1)
    values = random.standard_normal(10_000) * 10.0 ** random.integers(-12, 12, 10_000)
    total = exact_sum(comm, values)
    assert total == pytest.approx(math.fsum(values), rel=1e-14)
    assert exact_sum(comm, random.permutation(values)) == total
    assert float(np.sum(values)) != float(np.sum(np.sort(values)))  # what a plain sum does


def test_exact_sum_of_awkward_values(comm):
    assert exact_sum(comm, np.empty(0)) == 0.0
    assert exact_sum(comm, np.zeros(5)) == 0.0
    assert exact_sum(comm, np.array([1e300, 1e300, -1e300])) == 1e300
    assert exact_sum(comm, np.array([3e-310, 1e-310])) == pytest.approx(4e-310)
    assert exact_sum(comm, np.array([1.0, 2.0**-60, -1.0])) == 2.0**-60
    assert math.isnan(exact_sum(comm, np.array([1.0, np.nan])))
    assert math.isnan(exact_sum(comm, np.array([1.0, np.inf])))


def test_several_sums_are_those_of_each_row(comm):
    random = np.random.default_rng(2)
    rows = random.standard_normal((4, 1000)) * 10.0 ** random.integers(-12, 12, (4, 1000))
    rows[1] *= 1e-200
    rows[2] = 0.0
    assert exact_sums(comm, rows) == [exact_sum(comm, row) for row in rows] == Sums(comm).of(rows)
    rows[3, 7] = np.nan
    found = exact_sums(comm, rows)
    assert found[:3] == [exact_sum(comm, row) for row in rows[:3]] and math.isnan(found[3]), "a row that is not finite spoils no other"
    assert exact_sums(comm, np.empty((2, 0))) == [0.0, 0.0]
    assert Sums(comm).count(3) == 3 * comm.size and Sums(comm).largest(-2.5) == -2.5


def test_errors_pass_through(comm):
    with pytest.raises(KeyError):
        with agree_on_error(comm):
            raise KeyError("x")
    with pytest.raises(ZeroDivisionError):
        on_root(comm, lambda: 1 / 0)
    assert on_root(comm, max, 2, 3) == 3


def test_who_speaks_first_of_a_failure(monkeypatch):
    """The rank that raised what all agreed on, else the lowest; nobody waits twice, and of a thousand ranks the last waits no longer than the tenth of ten."""
    waits = []
    monkeypatch.setattr(module.time, "sleep", waits.append)

    def turn(rank, size, **of_error):
        error = KeyError("x")
        error.__dict__.update(of_error)
        for _ in range(2):
            await_turn(SimpleNamespace(rank=rank, size=size), error)
        return waits.pop() if waits else 0.0

    assert turn(0, 1) == turn(0, 2) == turn(3, 4, raised_by=3) == 0.0
    assert turn(1, 2) == 0.5 and turn(2, 3) == 1.0 and turn(999, 1000) < 5.0 < turn(0, 4, raised_by=3) + 1.0
    assert turn(9, 10) == 4.5 and waits == []
