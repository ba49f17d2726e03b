"""Disks that fill up and folders that vanish while a job runs: one sentence, exit code 1, and what was complete can be read."""
import json
import shutil
import subprocess
import time

import pytest

from pdhpc.output.fields import frame_times, read_frame
from tests.faults.soak import RUN, SCENE, last_step, start


@pytest.fixture
def small_disk(tmp_path):
    """A folder with room for a few frames; needs the right to mount one."""
    folder = tmp_path / "small"
    folder.mkdir()
    try:
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2500k", "tmpfs", str(folder)], capture_output=True)
    except OSError:
        pytest.skip("there is no mount")
    if mounted.returncode:
        pytest.skip("no file system may be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def ends_with_a_sentence(job, *words):
    _, said = job.communicate(timeout=60)
    lines = [line for line in said.splitlines() if line.startswith("pdhpc: ")]
    assert job.returncode == 1 and len(lines) == 1 and all(word in lines[0] for word in words), said


@pytest.mark.parametrize("ranks, what", [(1, "fields/frame_"), (2, "fields/frame_"), (2, "checkpoint/step_")])
def test_a_full_disk(tmp_path, small_disk, ranks, what):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    more = ["--set", "output.frames=100"] if "frame" in what else ["--set", "output.frames=1", "--set", "output.history_every=1e-7"]
    if "step" in what:
        (small_disk / "filler").write_bytes(bytes(900_000))
    ends_with_a_sentence(start(ranks, "run", scene, "-o", small_disk / "out", *RUN, *more), what, "No space left on device")
    assert frame_times(small_disk / "out") and read_frame(small_disk / "out")
    assert json.loads((small_disk / "out" / "run.json").read_text())["status"] in ("failed", "running")


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_output_folder_that_is_removed(tmp_path, ranks):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    job = start(ranks, "run", scene, "-o", tmp_path / "out", *RUN)
    while job.poll() is None and last_step(tmp_path / "out") < 8:
        time.sleep(0.02)
    shutil.rmtree(tmp_path / "out", ignore_errors=True)
    ends_with_a_sentence(job, "cannot be", "No such file or directory")
