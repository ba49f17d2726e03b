import math
import os
import subprocess
import sys
from typing import NamedTuple

import numba
import numpy as np
import pytest

from pdhpc import jit


@jit.kernel
def _divide(a, b):
    return a / b


def test_division_by_zero_follows_ieee():
    assert math.isinf(_divide(1.0, 0.0)) and math.isnan(_divide(0.0, 0.0))


@jit.kernel
def _ordered_sum(values):
    total = 0.0
    for value in values:
        total += value
    return total


def test_sums_keep_their_order():
    values = np.array([1e16, 1.0, -1e16, 1.0])  # (1e16 + 1) - 1e16 + 1 = 1 in this order, 2 in the best one
    assert _ordered_sum(values) == 1.0


class Square(NamedTuple):
    side: float


class Hexagon(NamedTuple):
    side: float


def area(shape, times):
    """Return the area of a shape, several times."""


def perimeter(shape):
    """Return the length of a shape's rim."""


@jit.implements(area, Square)
def _area_of_square(shape, times):
    return times * shape.side * shape.side


@jit.implements(area, Hexagon)
def _area_of_hexagon(shape, times):
    return times * 2.5 * shape.side * shape.side


@jit.implements(perimeter, Square)
def _perimeter_of_square(shape):
    return area(shape, 4) / shape.side  # a body may call other functions with bodies


@jit.kernel
def _sum_of_areas(shape, n):
    total = 0.0
    for k in range(n):
        total += area(shape, k)
    return total


@jit.kernel
def _perimeter(shape):
    return perimeter(shape)


def test_a_function_has_a_body_for_each_record():
    assert _sum_of_areas(Square(2.0), 3) == 4.0 * (0 + 1 + 2)
    assert _sum_of_areas(Hexagon(2.0), 3) == 10.0 * (0 + 1 + 2)
    assert _perimeter(Square(5.0)) == 20.0


def test_the_decorated_body_stays_a_plain_function_and_the_empty_one_empty():
    assert _area_of_square(Square(2.0), 1) == 4.0 and area(Square(2.0), 1) is None


def test_a_record_without_a_body_does_not_compile():
    with pytest.raises(numba.core.errors.TypingError, match="perimeter"):
        _perimeter(Hexagon(1.0))


def cache_folder(**variables):
    """The folder that a fresh process caches kernels in."""
    words = "from pdhpc import jit; import numba; print(numba.config.CACHE_DIR)"
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return subprocess.run([sys.executable, "-c", words], env={**environment, **variables}, capture_output=True, text=True, check=True).stdout.strip()


def test_cache_folder_changes_with_the_sources(tmp_path):
    assert cache_folder(NUMBA_CACHE_DIR=str(tmp_path)) == str(tmp_path / jit._source_digest())


def test_without_a_home_to_write_to_the_cache_is_temporary(tmp_path):
    (tmp_path / "file").write_text("")  # a folder cannot be made below a file, whoever asks
    folder = cache_folder(XDG_CACHE_HOME=str(tmp_path / "file"), TMPDIR=str(tmp_path))
    assert folder.startswith(str(tmp_path / "pdhpc-")) and folder.endswith(jit._source_digest())
