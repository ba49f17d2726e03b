"""Kill a random rank of a run at a random moment, see that the job ends, and go on from its checkpoint: python -m tests.faults.soak [TIMES] [RANKS]."""
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from pdhpc.output.checkpoint import generations
from pdhpc.output.fields import read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.study.launch import launch_command
from pdhpc.study.verify.fracture import GROWING_CRACK

STEPS = 4  # between two checkpoints: much of the time is spent writing them
SCENE = GROWING_CRACK + f"\n[checkpoint]\nsteps = {STEPS}\nat_end = false\n"
RUN = ["--set", "time.end=30e-6", "--set", "output.frames=10", "--set", "output.history_every=2e-7", "--set", "output.pictures=false", "--quiet"]
ENDS_WITHIN = 10.0  # s


def start(ranks, *words):
    """Start `python -m pdhpc words`; return the process, in a group of its own."""
    command, environment = launch_command(ranks, [sys.executable, "-m", "pdhpc", *map(str, words)])
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)


def ranks_of(launcher):
    """Return the process ids of the ranks below mpirun."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, rest = status.read_text().split(" (", 1)
            parent, command = int(rest.rsplit(") ", 1)[1].split()[1]), (status.parent / "cmdline").read_text()
        except (OSError, ValueError):  # it is gone
            continue
        if parent == launcher and "pdhpc" in command:
            found.append(int(pid))
    return sorted(found)


def last_step(folder):
    """Return the last step in the history of a run, or -1."""
    path = folder / "history.csv"
    steps = read_history(path)["step"] if path.exists() and path.stat().st_size else []
    return int(steps[-1]) if len(steps) else -1


def kill_one(ranks, scene, folder, after, chance):
    """Start a run, kill one of its ranks some seconds after its first row; return (seconds until the job ended, its exit code)."""
    job = start(ranks, "run", scene, "-o", folder, *RUN)
    while job.poll() is None and last_step(folder) < 0:
        time.sleep(0.02)
    time.sleep(after)
    pids, killed = ranks_of(job.pid), time.monotonic()
    if pids and job.poll() is None:
        os.kill(chance.choice(pids), signal.SIGKILL)
    try:
        code = job.wait(ENDS_WITHIN)
    except subprocess.TimeoutExpired:
        os.killpg(job.pid, signal.SIGKILL)
        job.wait()
        raise AssertionError(f"the job still ran {ENDS_WITHIN:g} s after one of its ranks was killed") from None
    return time.monotonic() - killed, code


def differences(one, other):
    """Return what differs between two runs: names of columns of the history and of fields of the last frame."""
    a, b = read_history(one / "history.csv"), read_history(other / "history.csv")
    found = [column for column in a if not np.array_equal(a[column], b[column], equal_nan=True)]
    order = [np.argsort(read_points(folder)["id"]) for folder in (one, other)]
    a, b = read_frame(one)[2], read_frame(other)[2]
    return found + [name for name in a if not np.array_equal(a[name][order[0]], b[name][order[1]])]


def soak(times, ranks=2, seed=0, say=print):
    """Kill `times` runs, and go on with each; an AssertionError says what went wrong."""
    chance, folder = random.Random(seed), Path(tempfile.mkdtemp())
    try:
        scene = folder / "scene.toml"
        scene.write_text(SCENE)
        started = time.monotonic()
        whole = start(ranks, "run", scene, "-o", folder / "whole", *RUN)
        while whole.poll() is None and last_step(folder / "whole") < 0:
            time.sleep(0.02)
        began = time.monotonic()
        assert whole.wait(600) == 0, whole.stderr.read()
        length = time.monotonic() - began
        say(f"uninterrupted: {length:.1f} s of stepping, {began - started:.1f} s before")
        for number in range(times):
            after = chance.uniform(0.0, length)
            seconds, code = kill_one(ranks, scene, folder / "killed", after, chance)
            reached, saved = last_step(folder / "killed"), [int(path.stem.split("_")[1]) for path in generations(folder / "killed")]
            assert code != 0 or reached == last_step(folder / "whole"), f"a job that was killed ended with exit code {code}"
            assert reached < STEPS or (saved and saved[0] > reached - 2 * STEPS), f"killed at step {reached} or later, its newest checkpoint is of step {saved[:1]}"
            again = start(ranks, *(("restart", folder / "killed", "--quiet") if saved else ("run", scene, "-o", folder / "killed", "--overwrite", *RUN)))
            assert again.wait(600) == 0, again.stderr.read()
            wrong = differences(folder / "whole", folder / "killed")
            assert not wrong, f"after {after:.2f} s, restarted from step {saved[:1]}: {', '.join(wrong)} differ"
            say(f"{number + 1}: killed {after:.2f} s after the first row, ended in {seconds:.2f} s with {code}; from step {saved[0] if saved else 0} of {last_step(folder / 'whole')}: equal")
            shutil.rmtree(folder / "killed")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    soak(int(sys.argv[1]) if len(sys.argv) > 1 else 100, int(sys.argv[2]) if len(sys.argv) > 2 else 2)
