import errno
import json
import os
import stat
import subprocess
import sys

import numpy as np
import pytest

from pdhpc.output.record import Lock, OutputError, check_directory, claim_directory, reason, write_json, write_text, note_failure


def test_json_of_numpy_and_of_what_json_cannot_say(tmp_path):
    write_json(tmp_path / "a.json", {"n": np.int64(3), "x": np.float64(0.5), "v": np.arange(2), "nan": float("nan"), "inf": np.inf, "t": (1, tmp_path)})
    assert json.loads((tmp_path / "a.json").read_text()) == {"n": 3, "x": 0.5, "v": [0, 1], "nan": None, "inf": "inf", "t": [1, str(tmp_path)]}


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    write_text(tmp_path / "a", "old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OutputError, match="No space left"):
        write_text(tmp_path / "a", "new")
    assert (tmp_path / "a").read_text() == "old"


def test_a_new_folder_is_made_with_its_parents(tmp_path):
    claim_directory(tmp_path / "a" / "b", False)
    assert (tmp_path / "a" / "b").is_dir()


@pytest.mark.parametrize("name", ["run.json", "history.csv", "fields.h5"])
def test_another_run_is_refused(tmp_path, name):
    (tmp_path / name).write_text("x")
    with pytest.raises(OutputError, match="holds another run") as caught:
        claim_directory(tmp_path, False)
    assert caught.value.exit_code == 2 and (tmp_path / name).read_text() == "x"


def test_overwriting_removes_what_a_run_wrote_and_nothing_else(tmp_path):
    (tmp_path / "fields").mkdir()
    for name in ("run.json", "history.csv", "fields.h5", "fields.xdmf", "damage.png", "notes.txt", "photo.png", "fields/frame_000001.h5", "fields/mine.txt"):
        (tmp_path / name).write_text("x")
    claim_directory(tmp_path, True)
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")}
    assert left == {"notes.txt", "photo.png", "fields", "fields/mine.txt"}


def test_copies_that_users_keep_are_theirs(tmp_path):
    for name in ("checkpoint/step_000000120.h5", "checkpoint/step_000000120.h5.part", "checkpoint/old_step_000000120.h5", "checkpoint/backup.h5", "fields/points.h5",
                 "fields/frame_000012.h5", "fields/frame_mine.h5"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    claim_directory(tmp_path, True)
    assert sorted(path.name for path in tmp_path.rglob("*.*")) == ["backup.h5", "frame_mine.h5", "old_step_000000120.h5"]


def test_reasons_are_words():
    assert [reason(error) for error in (KeyError("scene"), KeyError("no object 'u'"), ValueError("one\ntwo"), MemoryError(), OSError(2, "No such file"))] == [
        "scene is missing", "no object 'u'", "one", "MemoryError", "No such file"]


def test_files_in_the_way(tmp_path):
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(OutputError, match="is a file"):
            check_directory(path, True)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="not writable"):
        check_directory(tmp_path / "out", False)


def test_a_folder_has_one_job_at_a_time(tmp_path):
    one, other = Lock(), Lock()
    one.take(tmp_path / "new")
    with pytest.raises(OutputError, match="another job writes to it now") as caught:
        other.take(tmp_path / "new")
    assert caught.value.exit_code == 2
    one.release()
    other.take(tmp_path / "new")
    other.release()


def test_the_lock_of_a_job_that_was_killed_is_gone(tmp_path):
    words = f"import sys; from pdhpc.output.record import Lock; lock = Lock(); lock.take({str(tmp_path)!r}); print('held', flush=True); sys.stdin.read()"
    child = subprocess.Popen([sys.executable, "-c", words], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert child.stdout.readline() == b"held\n"
    with pytest.raises(OutputError, match="another job"):
        Lock().take(tmp_path)
    child.kill()
    child.wait()
    lock = Lock()
    lock.take(tmp_path)
    lock.release()


def test_folders_that_cannot_be_locked_hold_a_file_that_can(tmp_path, monkeypatch):
    """As on NFS."""
    import fcntl

    flock = fcntl.flock

    def nfs(descriptor, operation):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EBADF, "Bad file descriptor")
        flock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", nfs)
    one, other = Lock(), Lock()
    one.take(tmp_path)
    assert one.warning is None
    with pytest.raises(OutputError, match="another job writes to it now"):
        other.take(tmp_path)
    one.release()
    other.take(tmp_path)
    other.release()


def test_a_folder_without_locks_is_said(tmp_path, monkeypatch):
    import fcntl

    def none(descriptor, operation):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    lock = Lock()
    lock.take(tmp_path)
    assert "knows no locks (No locks available)" in lock.warning
    lock.release()


def test_a_failure_that_nobody_expected_is_noted(tmp_path):
    write_json(tmp_path / "run.json", {"status": "running", "steps": 0, "title": "t"})
    note_failure(tmp_path, KeyError("lost"), steps=7)
    assert json.loads((tmp_path / "run.json").read_text()) == {"status": "failed", "steps": 7, "title": "t", "error": "KeyError: 'lost'"}
    note_failure(tmp_path / "gone", KeyError("lost"))
    (tmp_path / "run.json").write_text("{")
    note_failure(tmp_path, KeyError("lost"))
    assert (tmp_path / "run.json").read_text() == "{", "what cannot be read is left"
