"""Kill a random rank of a run at a random moment, see that the job ends, and go on from its checkpoint: tools/soak."""
import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.output.checkpoint import FOLDER, generations
from pdhpc.output.fields import frame_times, read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.study.launch import launch_command
from tests.faults.methods import METHODS

SCENE, RUN = METHODS["particles"].scene(), METHODS["particles"].words()
ENDS_WITHIN = 10.0  # s
_MOST_RANKS = 4  # of restarts on another number of them
_SECONDS = {"load_imbalance"}  # columns of the history that measure seconds


class Killed(NamedTuple):
    """What became of a job: seconds until it ended, its exit code, whether a checkpoint was being written."""

    seconds: float
    code: int
    amid_writing: bool


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


def saved_step(folder):
    """Return the step of the newest checkpoint of a run, 0 without any."""
    return max((int(path.stem.split("_")[1]) for path in generations(folder)), default=0)


def _being_written(folder):
    return any((folder / FOLDER).glob("*.part"))


def _rows(folder):
    """Return the number of lines of a run's history: cheap to ask for often."""
    path = folder / "history.csv"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def kill_one(job, folder, rows, amid, chance):
    """Kill one rank of a run once its history has some rows, with `amid` when the next checkpoint is being written; return Killed, or None if it ended before."""
    while job.poll() is None and _rows(folder) < rows:
        time.sleep(2e-3)
    time.sleep(chance.uniform(0.0, 0.02))
    pids = ranks_of(job.pid)
    while amid and job.poll() is None and not _being_written(folder):
        time.sleep(2e-4)
    killed = time.monotonic()
    if not pids or job.poll() is not None:
        assert job.wait() == 0, job.stderr.read()
        return None
    with contextlib.suppress(ProcessLookupError):
        os.kill(chance.choice(pids), signal.SIGKILL)
    try:
        code = job.wait(ENDS_WITHIN)
    except subprocess.TimeoutExpired:
        os.killpg(job.pid, signal.SIGKILL)
        job.wait()
        raise AssertionError(f"the job still ran {ENDS_WITHIN:g} s after one of its ranks was killed") from None
    return Killed(time.monotonic() - killed, code, _being_written(folder))


def differences(one, other):
    """Return what differs between two runs: names of columns of the history, and fields of the last frame."""
    a, b = read_history(one / "history.csv"), read_history(other / "history.csv")
    found = [column for column in a if column not in _SECONDS and not np.array_equal(a[column], b[column], equal_nan=True)]
    found += [] if frame_times(one) == frame_times(other) else ["times of frames"]
    order = [np.argsort(read_points(folder)["id"]) for folder in (one, other)]
    a, b = read_frame(one)[2], read_frame(other)[2]
    return found + [name for name in a if not np.array_equal(a[name][order[0]], b[name][order[1]])]


def kill_and_go_on(run, ranks, again_on, folder, amid, chance):
    """Kill a run of folder/scene.toml and go on with it; return (Killed, the step it went on from), or None if it ended before.

    An AssertionError says what went wrong.
    """
    scene, out, whole = folder / "scene.toml", folder / "killed", folder / "whole"
    shutil.rmtree(out, ignore_errors=True)
    rows = chance.randint(2, _rows(whole) - 1)
    killed = kill_one(start(ranks, "run", scene, "-o", out, *run.words()), out, rows, amid, chance)
    if killed is None:
        return None
    reached, saved = last_step(out), saved_step(out)
    assert killed.code != 0 or reached == last_step(whole), f"a job that was killed ended with exit code {killed.code}"
    assert reached <= saved + run.steps, f"killed at step {reached} or later, its newest checkpoint is of step {saved}"
    again = start(again_on, *(("restart", out, "--quiet") if saved else ("run", scene, "-o", out, "--overwrite", *run.words())))
    assert again.wait(600) == 0, again.stderr.read()
    wrong = differences(whole, out)
    assert not wrong, f"gone on from step {saved} on {again_on} ranks: {', '.join(wrong)} differ"
    return killed, saved


def soak(times, ranks=2, methods=tuple(METHODS), seed=0, say=print):
    """Kill `times` runs of each of some methods, each second one while it writes a checkpoint, and go on with each; an AssertionError says what went wrong.

    Particles of one step also go on on other numbers of ranks: what they do has the same bits there.
    """
    for method in methods:
        run, chance, folder = METHODS[method], random.Random(f"{method} {seed}"), Path(tempfile.mkdtemp())
        try:
            (folder / "scene.toml").write_text(run.scene())
            job = start(ranks, "run", folder / "scene.toml", "-o", folder / "whole", *run.words())
            assert job.wait(600) == 0, job.stderr.read()
            last, done = last_step(folder / "whole"), []
            while len(done) < times:
                again_on = chance.randint(1, _MOST_RANKS) if method == "particles" else ranks
                found = kill_and_go_on(run, ranks, again_on, folder, len(done) % 2 == 1, chance)
                if found is None:
                    continue
                killed, saved = found
                done.append(killed)
                say(f"{method} {len(done)}: killed{' amid a checkpoint' * killed.amid_writing}, ended in {killed.seconds:.2f} s with {killed.code};"
                    f" on {again_on} ranks from step {saved} of {last}: equal")
            codes = ", ".join(map(str, sorted({killed.code for killed in done})))
            say(f"{method}: {times} kills on {ranks} ranks, {sum(killed.amid_writing for killed in done)} of them amid a checkpoint: all ended within"
                f" {max(killed.seconds for killed in done):.2f} s with {codes}, and went on to the same answer")
        finally:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    unknown = [name for name in sys.argv[3:] if name not in METHODS]
    if unknown:
        sys.exit(f"soak: {unknown[0]}; allowed is {', '.join(METHODS)}")
    soak(int(sys.argv[1]) if len(sys.argv) > 1 else 100, int(sys.argv[2]) if len(sys.argv) > 2 else 2, tuple(sys.argv[3:]) or tuple(METHODS),
         say=lambda words: print(words, flush=True))
