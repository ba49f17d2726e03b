"""Disks that fill up and folders that vanish while a job runs: one sentence, exit code 1, and what was complete can be read."""
import json
import shutil
import subprocess
import time

import pytest

from pdhpc.output.checkpoint import generations, read_header
from pdhpc.output.fields import frame_times, read_frame
from tests.faults.injected import begin, end, one_sentence, record
from tests.faults.soak import RUN, SCENE, differences, last_step, start


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


LIMIT = """
import resource
from pdhpc.output import rows_file
def write_file(comm, path, data, attributes, once=rows_file.write_file):
    if RANK == {rank} and path.name == {name!r}:
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
    once(comm, path, data, attributes)
import pdhpc.output.checkpoint, pdhpc.output.fields
pdhpc.output.checkpoint.write_file = pdhpc.output.fields.write_file = write_file
"""
"""From a file of this name on a rank may not write beyond 200 kB of a file, as when a quota is used up: files are of half a megabyte."""


@pytest.mark.parametrize("ranks, rank, name", [
    (1, 0, "frame_000046.h5"), (2, 1, "frame_000046.h5"), (1, 0, "step_000000048.h5"), (2, 0, "step_000000048.h5"), (2, 1, "step_000000048.h5"),
])
def test_a_quota_that_is_used_up(tmp_path, ranks, rank, name):
    """HDF5 would crash, or wait for ever; what is complete stays, and once there is room again the run goes on to the same end."""
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(SCENE)
    code, said = end(begin(ranks, LIMIT.format(rank=rank, name=name), "run", scene, "-o", out, *RUN))
    assert code == 1 and f"{name}: cannot be written (File too large)" in one_sentence(said), said
    assert record(out)["status"] == "failed" and one_sentence(said) == f"pdhpc: {record(out)['error']}"
    assert [read_header(path)["step"] for path in generations(out)] == [44, 40] and len(frame_times(out)) in (2, 3) and read_frame(out)
    assert not list(out.rglob("*.part"))
    if rank == 1 and "frame" in name:
        assert end(begin(ranks, "", "restart", out, "--quiet")) == (0, [])
        assert end(begin(ranks, "", "run", scene, "-o", tmp_path / "whole", *RUN)) == (0, [])
        assert differences(tmp_path / "whole", out) == []


def test_a_folder_that_becomes_read_only(tmp_path):
    """Here the folder of checkpoints, over which another file system is put: one with open files, as the log, cannot be made read-only."""
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(SCENE)
    job = begin(2, "", "run", scene, "-o", out, *RUN, "--set", "time.end=300e-6")
    while job.poll() is None and last_step(out) < 20:
        time.sleep(0.02)
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", str(out / "checkpoint")], capture_output=True)
    if mounted.returncode:
        job.kill()
        job.wait()
        pytest.skip("no file system may be mounted here")
    code, said = end(job)
    subprocess.run(["umount", str(out / "checkpoint")], check=True)
    assert code == 1 and "checkpoint/step_" in one_sentence(said)
    assert any(f"cannot be written ({words})" in said[0] for words in ("Read-only file system", "No such file or directory")), "the latter of one half written"
    assert record(out)["status"] == "failed" and frame_times(out) and read_frame(out) and [read_header(path) for path in generations(out)]
    assert end(begin(2, "", "restart", out, "--quiet", "--set", "time.end=60e-6")) == (0, [])


def test_kernels_that_cannot_be_stored(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    (tmp_path / "scene.toml").write_text(SCENE)
    code, said = end(begin(2, "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))\n", "run", tmp_path / "scene.toml", "-o", tmp_path / "out", *RUN))
    assert code == 1 and "cannot be written (File too large); NUMBA_CACHE_DIR names another folder" in one_sentence(said) and not (tmp_path / "out").exists()
