"""Set how numba compiles every kernel of pdhpc: one decorator for kernels, one for functions inlined into them.

The cache of compiled kernels is keyed on a digest of the package's sources, because numba itself does not notice a change in a function that a cached
kernel inlines from another file. `NUMBA_CACHE_DIR`, when set, is respected (a node-local folder on clusters).
"""
import getpass
import hashlib
import os
import tempfile
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
    """Point numba's cache at a folder of this version of the sources: below $NUMBA_CACHE_DIR, the user's cache, or, where homes are read-only, a temporary folder."""
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pdhpc"
    temporary = Path(tempfile.gettempdir()) / f"pdhpc-{getpass.getuser()}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    digest = _source_digest()
    for root in [Path(chosen)] if chosen else [user, temporary]:
        folder = root / digest
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid():  # compiled code is only read from a folder of one's own
                numba.config.CACHE_DIR = str(folder)
                return
        except OSError:
            continue


_choose_cache_folder()

# Floating point operations are done as written: sums keep their order, NaN and inf survive, division by zero follows IEEE. What must be fast says so with
# explicit vectors (kernels/simd.py).
kernel = numba.njit(cache=True, error_model="numpy", boundscheck=False, nogil=True)
"""Compile and cache a loop over particles or bonds."""

inlined = numba.njit(forceinline=True, error_model="numpy", boundscheck=False, nogil=True)
"""Compile a function that is inlined into kernels."""
