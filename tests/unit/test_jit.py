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
