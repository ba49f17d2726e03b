"""Launch a program on several ranks: srun inside a Slurm allocation, else mpirun."""
import os
import shutil
import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[3]
_OF_A_RANK = ("OMPI_COMM", "OMPI_MCA_ess", "OMPI_MCA_orte", "PMIX", "PMI_")  # variables that would make a child think it is a rank of this job


def launch(ranks, words, folder):
    """Run `python -m pdhpc words` on some ranks in `folder` and return the finished process."""
    command, environment = launch_command(ranks, [sys.executable, "-m", "mpi4py", "-m", "pdhpc", *words])
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)


def launch_command(ranks, program):
    """Return (command, environment) that runs `program`, a list of words, on some ranks."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith(_OF_A_RANK)}
    environment["OMP_NUM_THREADS"] = "1"
    environment["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *filter(None, [environment.get("PYTHONPATH")])])
    if "SLURM_JOB_ID" in environment and shutil.which("srun"):
        return ["srun", "-n", str(ranks), "--overcommit", *program], environment
    return ["mpirun", "-n", str(ranks), *_mpirun_flags(ranks, environment), *program], environment


def _mpirun_flags(ranks, environment):
    """Return what Open MPI wants to be told; other MPIs take no flags."""
    version = subprocess.run(["mpirun", "--version"], capture_output=True, text=True, timeout=60).stdout
    if "Open MPI" not in version:
        return []
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        environment.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    return ["--oversubscribe"] if ranks > (os.cpu_count() or 1) else []
