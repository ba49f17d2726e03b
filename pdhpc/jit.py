"""Set how numba compiles every kernel of pdhpc: one decorator for kernels, one for functions inlined into them.

The cache of compiled kernels is keyed on a digest of the package's sources, because numba itself does not notice a change in a function that a cached
kernel inlines from another file. `NUMBA_CACHE_DIR`, when set, is respected (a node-local folder on clusters).
"""
import hashlib
import os
from pathlib import Path

import numba


def _source_digest():
    """Return a short digest of every source file of the package."""
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _choose_cache_folder():
    """Point numba's cache at `<user cache>/pdhpc/<digest>` unless the user chose a folder."""
    root = os.environ.get("NUMBA_CACHE_DIR")
    if root is None:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pdhpc"
    folder = Path(root) / _source_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # numba then falls back on its own choice
    numba.config.CACHE_DIR = str(folder)


_choose_cache_folder()

# Floating point operations are done as written: sums keep their order, NaN and inf survive, division by zero follows IEEE. What must be fast says so with
# explicit vectors (kernels/simd.py).
kernel = numba.njit(cache=True, error_model="numpy", boundscheck=False, nogil=True)
"""Compile and cache a loop over particles or bonds."""

inlined = numba.njit(inline="always", error_model="numpy")
"""Compile a function that is inlined into kernels."""
