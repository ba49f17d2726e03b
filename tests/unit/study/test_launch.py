import os
import subprocess
from pathlib import Path

import pytest

from pdhpc.study import launch

ROOT = Path(__file__).resolve().parents[3]


def test_srun_is_used_inside_an_allocation_and_mpirun_outside(monkeypatch):
    monkeypatch.setattr(launch.shutil, "which", lambda name: "/usr/bin/srun")
    monkeypatch.setenv("SLURM_JOB_ID", "1")
    assert launch.launch_command(3, ["a", "b"])[0] == ["srun", "-n", "3", "--overcommit", "a", "b"]
    assert launch.launch_command(3, ["a"], "mpirun")[0][:3] == ["mpirun", "-n", "3"]
    monkeypatch.delenv("SLURM_JOB_ID")
    assert launch.launch_command(3, ["a"])[0][:3] == ["mpirun", "-n", "3"] and launch.launch_command(3, ["a"], "srun")[0][0] == "srun"


def test_a_child_does_not_take_itself_for_a_rank(monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "4")
    command, environment = launch.launch_command(2, ["a"])
    assert "OMPI_COMM_WORLD_SIZE" not in environment and environment["OMP_NUM_THREADS"] == "1"


def test_cores_are_those_this_process_may_use():
    assert 1 <= launch.cores() <= (os.cpu_count() or 1)


@pytest.mark.parametrize("kind", ("strong", "weak"))
def test_job_arrays_run_their_task_of_the_study(kind, tmp_path):
    """The template, with a program that prints its arguments in the place of pdhpc."""
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    program = tmp_path / ".venv" / "bin" / "pdhpc"
    program.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    program.chmod(0o755)
    environment = {**os.environ, "SLURM_ARRAY_TASK_ID": "3", "SLURM_ARRAY_JOB_ID": "77", "USER": "me"}
    done = subprocess.run(["bash", ROOT / "slurm" / f"scaling_{kind}.sbatch"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    words = done.stdout.split()
    assert words == ["scale", f"runs/studies/{kind}_3d.toml", "-o", f"runs-out/{kind}_3d-77", "--set", "ranks=[1,2,4,8,16,32]", "--point", "3"]
