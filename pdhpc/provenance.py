"""What a run was made by, where, and of which files: versions, commit, hosts, shares of the ranks."""
import hashlib
import math
import platform
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np

from pdhpc import __version__

_SHOWN = 64  # lines of ranks in a log


def versions():
    """Return the versions of pdhpc and of what it runs on."""
    import h5py
    import mpi4py
    import numba
    import petsc4py
    from mpi4py import MPI

    packages = {"pdhpc": __version__, "python": platform.python_version(), "numpy": np.__version__, "numba": numba.__version__, "mpi4py": mpi4py.__version__}
    mpi = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\0 ")
    return {**packages, "mpi": mpi, "petsc4py": petsc4py.__version__, "h5py": h5py.__version__, "hdf5": h5py.version.hdf5_version}


def commit():
    """Return the git commit of the package's checkout, with "+" when it is modified, or None."""
    folder = Path(__file__).parent
    if not (folder.parent / ".git").exists():
        return None
    try:
        words = ["git", "-C", str(folder), "describe", "--always", "--dirty=+", "--abbrev=12"]
        return subprocess.run(words, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None


def hosts_of(comm):
    """Return {name: number of ranks} of the machines that a job runs on, on every rank; one name of each travels. Collective."""
    from mpi4py import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    leaders = comm.Split(0 if node.rank == 0 else MPI.UNDEFINED, comm.rank)
    found = None
    if leaders != MPI.COMM_NULL:
        found = {}
        for name, ranks in leaders.allgather((platform.node(), node.size)):
            found[name] = found.get(name, 0) + ranks
        leaders.Free()
    found = node.bcast(found)
    node.Free()
    return found


def introduction(simulation):
    """Return the first lines of the log of a Simulation, on rank 0. Collective."""
    scene, problem, hosts, seconds = simulation.scene, simulation.problem, simulation.hosts, simulation.seconds
    critical = "" if not math.isfinite(problem.critical_dt) else f", the critical one {problem.critical_dt:.6g} s"
    ranks = simulation.comm.size
    return [
        ", ".join(f"{name} {version}" for name, version in versions().items()) + f", commit {commit() or 'unknown'}",
        f"command: {shlex.join(sys.argv)}",
        f"scene: {scene.source}, {scene.title or 'without a title'}; model {scene.model}, method {scene.method}",
        *(f"file: {name}, SHA-256 {digest}" for name, digest in simulation.files.items()),
        f"{ranks} rank{'s' if ranks > 1 else ''}: " + ", ".join(f"{number} on {name}" for name, number in hosts.items()),
        *describe_shares(simulation.comm, problem.share()),
        f"compiled or loaded in {seconds['compile']:.2f} s, set up in {seconds['setup']:.2f} s",
        f"{problem.n_steps} steps of {problem.dt:.6g} s{critical}",
    ]


def describe_shares(comm, share):
    """Return lines that say how a body is shared out, on rank 0: the range of each number, and each rank's; a few numbers of each rank travel. Collective.

    share : {name: number}, this rank's, of the same names on every rank.
    """
    every = comm.gather(list(share.values()))
    if every is None:
        return []
    if comm.size == 1:
        return ["it has " + ", ".join(f"{number:,} {name}" for name, number in share.items())]
    numbers = np.array(every)
    ranges = ", ".join(f"{name} {column.min():,} to {column.max():,} (mean {column.mean():,.1f})" for name, column in zip(share, numbers.T))
    lines = [f"a rank has {ranges}"]
    lines += [f"rank {rank}: " + ", ".join(f"{number:,} {name}" for name, number in zip(share, row)) for rank, row in enumerate(numbers[:_SHOWN].tolist())]
    lines += [f"and {comm.size - _SHOWN} ranks more"] if comm.size > _SHOWN else []
    return lines


def checksums(scene):
    """Return ({name: SHA-256} of the files that a scene names and that are there, SHA-256 of its own or None). Local."""
    own = Path(scene.source)
    paths = {name: own.parent / name for name in scene.files}
    return {name: checksum(path) for name, path in paths.items() if path.is_file()}, checksum(own) if own.is_file() else None


def checksum(path):
    """Return the SHA-256 of a file, read piece by piece. Local.

    Raises
    ------
    OSError.
    """
    total = hashlib.sha256()
    with open(path, "rb") as file:
        while piece := file.read(1 << 22):
            total.update(piece)
    return total.hexdigest()
