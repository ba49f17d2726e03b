from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from pdhpc.output import rows_file
from pdhpc.output.record import OutputError
from pdhpc.output.rows_file import Rows, write_file, write_small


def test_rows_of_one_rank(comm):
    assert Rows.of(comm, [3, 0]) == [Rows(0, 3, 3), Rows(0, 0, 0)]


def test_a_file_is_complete_or_not_there(tmp_path, comm, monkeypatch):
    path = tmp_path / "a.h5"
    write_file(comm, path, {"x": np.arange(6.0).reshape(3, 2), "group/none": np.empty((0, 4), np.uint8)}, {"step": 3})
    with h5py.File(path) as file:
        assert file["x"][:].tolist() == [[0, 1], [2, 3], [4, 5]] and file["group/none"].shape == (0, 4) and file.attrs["step"] == 3
    monkeypatch.setattr(rows_file, "publish", lambda part, path: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_file(comm, tmp_path / "b.h5", {"x": np.zeros(1)}, {})
    assert not (tmp_path / "b.h5").exists()


def test_links_are_not_followed(tmp_path, comm):
    (tmp_path / "elsewhere").write_text("of somebody else")
    (tmp_path / "a.h5.part").symlink_to(tmp_path / "elsewhere")
    write_file(comm, tmp_path / "a.h5", {"x": np.zeros(3)}, {})
    assert (tmp_path / "elsewhere").read_text() == "of somebody else" and (tmp_path / "a.h5").is_file()


def test_what_the_system_says_is_said(tmp_path, comm):
    with pytest.raises(OutputError, match=r"nowhere/a.h5: cannot be written \(.*No such file or directory.*\)"):
        write_file(comm, tmp_path / "nowhere" / "a.h5", {"x": np.zeros(1)}, {})


def test_a_full_disk_is_seen_before_anything_is_written(tmp_path, comm, monkeypatch):
    monkeypatch.setattr(rows_file.os, "statvfs", lambda path: SimpleNamespace(f_bavail=100, f_frsize=1024, f_blocks=1000))
    write_file(comm, tmp_path / "a.h5", {"x": np.zeros(100)}, {})
    with pytest.raises(OutputError, match="b.h5: cannot be written .No space left on device: 102,400 bytes free, 80,000 needed"):
        write_file(comm, tmp_path / "b.h5", {"x": np.zeros(10000)}, {})
    assert [each.name for each in tmp_path.iterdir()] == ["a.h5"]


def test_a_write_that_takes_part_of_the_bytes_goes_on(tmp_path, comm, monkeypatch):
    once, values = rows_file.os.pwrite, np.arange(5000.0).reshape(-1, 2)
    monkeypatch.setattr(rows_file.os, "pwrite", lambda file, content, at: once(file, content[:777], at))
    write_file(comm, tmp_path / "a.h5", {"n": np.arange(3), "x": values[:, ::-1]}, {})
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file["x"][:], values[:, ::-1]) and file["n"][:].tolist() == [0, 1, 2]


@pytest.fixture
def quota():
    """Function of the most bytes that a file may have from now on."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda most: resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_quota_is_said_and_nothing_is_left(tmp_path, comm, quota):
    """HDF5 would crash when it closes such a file."""
    quota(100_000)
    with pytest.raises(OutputError, match="a.h5: cannot be written .File too large"):
        write_file(comm, tmp_path / "a.h5", {"x": np.zeros(10_000)}, {})
    write_small(tmp_path / "b.h5", lambda file: file.create_dataset("x", data=np.arange(3)))
    quota(100)
    with pytest.raises(OutputError, match="c.h5: cannot be written .File too large"):
        write_small(tmp_path / "c.h5", lambda file: file.create_dataset("x", data=np.zeros(3)))
    quota(100_000)
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["x"][:].tolist() == [0, 1, 2]
    assert [path.name for path in tmp_path.iterdir()] == ["b.h5"]
