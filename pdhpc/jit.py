"""Set how numba compiles every kernel of pdhpc: one decorator for kernels, one for functions inlined into them, one for functions with a body per record.

The cache of compiled kernels is keyed on a digest of the sources of kernels, because numba itself does not notice a change in a function that a cached
kernel inlines from another file. `NUMBA_CACHE_DIR`, when set, is respected (a node-local folder on clusters).
"""
import getpass
import hashlib
import inspect
import os
import platform
import tempfile
from pathlib import Path

import numba
from numba.extending import overload


def _source_digest():
    """Return a short digest of what compiles kernels, and of every source file that may have a part in one: all of kernels/ and materials/, and any that has one.

    A kernel elsewhere takes its constants from its own file or from these.
    """
    package = Path(__file__).parent
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()} {os.environ.get('PDHPC_KERNELS')}".encode())
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if path.parent.name in ("kernels", "materials") or b"pdhpc.jit" in text or path == Path(__file__):
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(text)
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
_OPTIONS = {"error_model": "numpy", "boundscheck": False, "nogil": True}
_UNCOUNTED = {"_nrt": False, **_OPTIONS}  # numba otherwise counts references to every array in records, in the middle of loops

kernel = numba.njit(cache=True, **_OPTIONS)
"""Compile and cache a loop over particles or bonds."""

sweep = numba.njit(cache=True, **_UNCOUNTED)
"""Compile and cache a loop over bonds that makes no array."""

inlined = numba.njit(forceinline=True, **_UNCOUNTED)
"""Compile a function that makes no array and is inlined into kernels."""


def implements(generic, record):
    """Give `generic`, a function that kernels call and that is empty itself, a body for the case that its first argument is a `record` (a NamedTuple class).

    So a sweep over bonds is written once for every law and every kind of family: numba picks the bodies when it compiles, and inlines them. They make no array.
    """

    def register(body):
        names = ", ".join(inspect.signature(generic).parameters)  # numba wants the function that chooses to have the parameters of `generic`
        scope = {"record": record, "body": body}
        exec(f"def choose({names}):\n    return body if getattr({names.split(',')[0]}, 'instance_class', None) is record else None", scope)
        overload(generic, jit_options={"forceinline": True, **_UNCOUNTED}, strict=False)(scope["choose"])
        return body

    return register
