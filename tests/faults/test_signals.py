"""Signals to a whole job: saved, stopped with exit code 3, gone on."""
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from pdhpc.output.checkpoint import generations, read_header
from pdhpc.output.record import Lock
from tests.faults.injected import AT_STEP, begin, end, one_sentence, record
from tests.faults.soak import RUN, SCENE, differences, last_step, ranks_of, start

ENDS_AT_ONCE = 10.0  # s, on a machine that is busy
QUIET = SCENE.replace("steps = 4\n", "")
LONG = [*RUN, "--set", "time.end=150e-6", "--set", "output.history_every=1e-7"]


def started(job, folder):
    """Wait until a run has written some rows."""
    while job.poll() is None and last_step(folder) < 8:
        time.sleep(0.02)


def wait_for_all(job, ranks, folder):
    """Wait until every rank has told that it began what is slow."""
    while job.poll() is None and len(list(folder.glob("begun*"))) < ranks:
        time.sleep(0.02)


def send(job, number, ranks, to):
    """Send a signal to the one process, or to mpirun, or to its ranks."""
    for pid in [job.pid] if ranks == 1 or to == "mpirun" else ranks_of(job.pid):
        os.kill(pid, number)


SLOW_STEP = "import time\n" + AT_STEP.format(when="True", step=42, deed="open({path!r} + str(RANK), 'w'); [time.sleep(0.05) for _ in range(600)]")
"""Half a minute in which no rank looks at signals: what ends the job is the second one."""


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


def test_sigint_to_the_ranks_saves_and_stops_and_the_run_goes_on(tmp_path):
    (tmp_path / "scene.toml").write_text(QUIET)
    assert end(begin(2, "", "run", tmp_path / "scene.toml", "-o", tmp_path / "whole", *LONG)) == (0, [])
    job = begin(2, "", "run", tmp_path / "scene.toml", "-o", tmp_path / "out", *LONG)
    started(job, tmp_path / "out")
    send(job, signal.SIGINT, 2, "ranks")
    code, said = end(job)
    assert code == 3 and one_sentence(said).startswith("pdhpc: stopped on request at step ")
    assert record(tmp_path / "out")["status"] == "stopped" and len(generations(tmp_path / "out")) == 1
    assert end(begin(2, "", "restart", tmp_path / "out", "--quiet")) == (0, [])
    assert differences(tmp_path / "whole", tmp_path / "out") == []


@pytest.mark.parametrize("ranks, number, to, code", [
    (1, signal.SIGINT, "ranks", -2), (1, signal.SIGTERM, "ranks", -15), (2, signal.SIGINT, "ranks", 130), (2, signal.SIGTERM, "ranks", 143), (2, signal.SIGINT, "mpirun", 1),
], ids=str)
def test_a_second_one_ends_the_job_at_once(tmp_path, ranks, number, to, code):
    """No hang, no traceback; what was complete can be gone on from. mpirun has exit codes of its own."""
    (tmp_path / "scene.toml").write_text(SCENE)
    job = begin(ranks, SLOW_STEP.format(path=str(tmp_path / "begun")), "run", tmp_path / "scene.toml", "-o", tmp_path / "out", *LONG)
    wait_for_all(job, ranks, tmp_path)
    below, sent = [job.pid] if ranks == 1 else ranks_of(job.pid), time.monotonic()
    send(job, number, ranks, to)
    time.sleep(0.2)
    assert job.poll() is None, "one alone does not"
    send(job, number, ranks, to)
    assert end(job) == (code, [])
    while any(os.path.exists(f"/proc/{pid}") for pid in below) and time.monotonic() - sent < ENDS_AT_ONCE:
        time.sleep(0.05)
    assert time.monotonic() - sent < ENDS_AT_ONCE and record(tmp_path / "out")["status"] == "running"
    assert [read_header(path)["step"] for path in generations(tmp_path / "out")] == [40, 36]
    if ranks == 1:
        assert end(begin(1, "", "restart", tmp_path / "out", "--quiet", "--set", "time.end=10e-6")) == (0, [])


SLOW = """
import time, pdhpc.simulation as simulation
def build(scene, comm, once=simulation.build):
    open({path!r} + str(RANK), "w")
    for _ in range(40):
        time.sleep(0.1)
    return once(scene, comm)
simulation.build = build
"""
"""Four seconds of set-up, of whose begin a file tells."""


@pytest.mark.parametrize("ranks, number, code", [(1, signal.SIGINT, -2), (2, signal.SIGINT, 130), (2, signal.SIGTERM, 143), (2, signal.SIGUSR1, 0)], ids=str)
def test_before_the_first_step_there_is_nothing_to_save(tmp_path, ranks, number, code):
    """A job that is asked to stop ends without a trace or a traceback; one that is asked to save its state goes on."""
    (tmp_path / "scene.toml").write_text(QUIET)
    job = begin(ranks, SLOW.format(path=str(tmp_path / "begun")), "run", tmp_path / "scene.toml", "-o", tmp_path / "out", *RUN)
    wait_for_all(job, ranks, tmp_path)
    send(job, number, ranks, "ranks")
    assert end(job) == (code, [])
    assert (tmp_path / "out").exists() == (code == 0)
