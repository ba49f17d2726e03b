import math
import os
import subprocess
import sys

import numpy as np

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


def test_cache_folder_changes_with_the_sources(tmp_path):
    words = "from pdhpc import jit; import numba; print(numba.config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", words], env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(tmp_path / jit._source_digest())
