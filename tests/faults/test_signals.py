"""Signals to a whole job: saved, stopped with exit code 3, gone on."""
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from pdhpc.output.checkpoint import generations
from pdhpc.output.record import Lock
from tests.faults.soak import RUN, SCENE, differences, last_step, start

QUIET = SCENE.replace("steps = 4\n", "")
LONG = [*RUN, "--set", "time.end=150e-6", "--set", "output.history_every=1e-7"]


def started(job, folder):
    """Wait until a run has written some rows."""
    while job.poll() is None and last_step(folder) < 8:
        time.sleep(0.02)


def test_sigterm_saves_and_stops_and_the_run_goes_on(tmp_path):
    (tmp_path / "scene.toml").write_text(QUIET)
    command = [sys.executable, "-m", "pdhpc", "run", tmp_path / "scene.toml", "-o"]
    assert subprocess.run([*command, tmp_path / "whole", *LONG], timeout=300).returncode == 0
    job = subprocess.Popen([*command, tmp_path / "stopped", *LONG], stderr=subprocess.PIPE, text=True)
    started(job, tmp_path / "stopped")
    job.send_signal(signal.SIGTERM)
    _, said = job.communicate(timeout=60)
    assert job.returncode == 3 and said.startswith("pdhpc: stopped on request at step "), said
    assert json.loads((tmp_path / "stopped" / "run.json").read_text())["status"] == "stopped" and len(generations(tmp_path / "stopped")) == 1
    assert subprocess.run([sys.executable, "-m", "pdhpc", "restart", tmp_path / "stopped", "--quiet"], timeout=300).returncode == 0
    assert differences(tmp_path / "whole", tmp_path / "stopped") == []
    again = subprocess.run([sys.executable, "-m", "pdhpc", "restart", tmp_path / "stopped", "--set", "time.dt=1e-9"], capture_output=True, text=True, timeout=300)
    assert again.returncode == 2 and "allowed is time.end" in again.stderr and len(again.stderr.splitlines()) == 1


def test_a_second_job_on_one_folder_is_refused(tmp_path):
    (tmp_path / "scene.toml").write_text(QUIET)
    lock = Lock()
    lock.take(tmp_path / "out")
    done = subprocess.run([sys.executable, "-m", "pdhpc", "run", tmp_path / "scene.toml", "-o", tmp_path / "out", *RUN], capture_output=True, text=True, timeout=300)
    lock.release()
    assert done.returncode == 2 and "another job writes to it now" in done.stderr and list((tmp_path / "out").iterdir()) == []


@pytest.mark.skipif("SLURM_JOB_ID" in os.environ, reason="mpirun passes the signal on")
def test_sigusr1_to_mpirun_saves_and_the_run_goes_on(tmp_path):
    (tmp_path / "scene.toml").write_text(QUIET)
    job = start(2, "run", tmp_path / "scene.toml", "-o", tmp_path / "out", *LONG)
    started(job, tmp_path / "out")
    job.send_signal(signal.SIGUSR1)
    _, said = job.communicate(timeout=120)
    assert job.returncode == 0 and len(generations(tmp_path / "out")) == 1, said
