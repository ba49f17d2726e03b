"""Launch a program on several ranks: srun inside a Slurm allocation, else mpirun."""
import functools
import os
import shutil
import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_OF_A_RANK = ("OMPI_COMM", "OMPI_MCA_ess", "OMPI_MCA_orte", "PMIX", "PMI_")  # variables that would make a child think it is a rank of this job


def launch(ranks, words, folder, timeout=600):
    """Run `python -m pdhpc words` on some ranks in `folder` and return the finished process."""
    command, environment = launch_command(ranks, [sys.executable, "-m", "mpi4py", "-m", "pdhpc", *words])
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=timeout)


def launch_command(ranks, program, launcher="auto"):
    """Return (command, environment) that runs `program`, a list of words, on some ranks; launcher "auto", "mpirun" or "srun"."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith(_OF_A_RANK)}
    environment["OMP_NUM_THREADS"] = "1"
    environment["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *filter(None, [environment.get("PYTHONPATH")])])
    if launcher == "srun" or (launcher == "auto" and "SLURM_JOB_ID" in environment and shutil.which("srun")):
        return ["srun", "-n", str(ranks), "--overcommit", *program], environment
    return ["mpirun", "-n", str(ranks), *_mpirun_flags(ranks, environment), *program], environment


def cores():
    """Return the number of cores this process may use, hardware threads counted once: how Open MPI counts slots."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        listed = subprocess.run(["lscpu", "-p=SOCKET,CORE"], capture_output=True, text=True, timeout=60).stdout
    except (OSError, subprocess.SubprocessError):
        return usable
    physical = len({line for line in listed.splitlines() if line and not line.startswith("#")})
    return min(usable, physical) if physical else usable


@functools.lru_cache
def _is_open_mpi():
    return "Open MPI" in subprocess.run(["mpirun", "--version"], capture_output=True, text=True, timeout=60).stdout


def _mpirun_flags(ranks, environment):
    """Return what Open MPI wants to be told; other MPIs take no flags."""
    if not _is_open_mpi():
        return []
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        environment.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    return ["--oversubscribe"] if ranks > cores() else []
