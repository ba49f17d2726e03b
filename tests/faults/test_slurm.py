"""The job template, with stand-ins for srun and scontrol: a job whose time is over is queued again, and goes on."""
import json
import os
import signal
import subprocess
import time
from pathlib import Path

from pdhpc.output.checkpoint import generations
from tests.faults.soak import SCENE, last_step

ROOT = Path(__file__).parents[2]
KERNELS = f"export NUMBA_CACHE_DIR={os.environ['NUMBA_CACHE_DIR']}" if "NUMBA_CACHE_DIR" in os.environ else "unset NUMBA_CACHE_DIR"  # those that are compiled
SRUN = f'#!/bin/sh\n{KERNELS}\necho $$ > "$SLURM_TMPDIR/task"\nexec "$@"\n'
SCONTROL = '#!/bin/sh\necho "$@" >> "$SLURM_TMPDIR/asked"\n'


def submit(folder, restarts):
    """Start the template's job on `folder`/scene.toml; return its process."""
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "USER": "somebody", "SLURM_JOB_ID": "7", "SLURM_TMPDIR": str(folder)}
    environment["SLURM_RESTART_COUNT"] = str(restarts)
    words = ["bash", "slurm/run.sbatch", folder / "scene.toml", folder / "out"]
    return subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def wait_for_rows(job, folder):
    """Wait until a job has written rows; return the process id of its task."""
    while job.poll() is None and last_step(folder / "out") < 8:
        time.sleep(0.02)
    return int((folder / "task").read_text())


def test_a_job_goes_on_after_its_time_is_over_and_after_a_node_failed(tmp_path):
    for name, text in (("srun", SRUN), ("scontrol", SCONTROL)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    text = SCENE.replace("steps = 4\n", "").replace("history_every = 1e-6", "history_every = 1e-7").replace("end = 20e-6", "end = 150e-6")
    (tmp_path / "scene.toml").write_text(text)
    job = submit(tmp_path, 0)
    os.kill(wait_for_rows(job, tmp_path), signal.SIGKILL)  # before anything was saved
    assert job.wait(60) == 128 + signal.SIGKILL and not generations(tmp_path / "out")
    (tmp_path / "out" / "history.csv").unlink()  # what is waited for
    job = submit(tmp_path, 1)
    os.kill(wait_for_rows(job, tmp_path), signal.SIGTERM)
    assert job.wait(60) == 3 and (tmp_path / "asked").read_text() == "requeue 7\n", job.stderr.read()
    saved = int(generations(tmp_path / "out")[0].stem.split("_")[1])
    job = submit(tmp_path, 2)
    assert job.wait(120) == 0, job.stderr.read()
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["status"] == "done" and f"goes on from step {saved}\n" in (tmp_path / "out" / "run.log").read_text()
