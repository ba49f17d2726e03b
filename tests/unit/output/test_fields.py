import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from pdhpc.output import rows_file
from pdhpc.output.fields import Cells, FieldWriter, frame_times, read_frame, read_points
from pdhpc.output.record import OutputError


def write(directory, comm, dim=2, frames=3, n=5):
    writer = FieldWriter(comm, directory, {"version": "1", "scene": {"a": 1}, "ranks": 1})
    x = np.random.default_rng(0).random((n, dim))
    writer.write_points(np.arange(n) * 10, x, np.full(n, 0.5), np.zeros(n, np.uint8))
    for number in range(frames):
        writer.write_frame(number * 7, number * 0.5, {"displacement": x + number, "damage": x[:, 0] * number, "stress": np.ones((n, dim, dim)) * number})
    return x


@pytest.mark.parametrize("dim", [2, 3])
def test_round_trip(tmp_path, comm, dim):
    x = write(tmp_path, comm, dim)
    points = read_points(tmp_path)
    assert np.array_equal(points["position"], x) and points["id"].tolist() == [0, 10, 20, 30, 40]
    assert [(step, time) for _, step, time in frame_times(tmp_path)] == [(0, 0.0), (7, 0.5), (14, 1.0)]
    time_, step, data = read_frame(tmp_path)
    assert (time_, step) == (1.0, 14)
    assert np.array_equal(data["displacement"][:, :dim], x + 2) and data["displacement"].shape == (5, 3)
    assert data["stress"].shape == (5, 9) and data["stress"].sum() == 5 * dim * dim * 2
    with h5py.File(tmp_path / "fields.h5") as file:
        assert file.attrs["scene"] == '{"a": 1}' and file["frames/000007/damage"].shape == (5,) and file["points/id"][1] == 10


def test_a_list_of_many_frames(tmp_path, comm):
    """Lists of more than 64 kB do not fit into the headers of HDF5's oldest format."""
    writer = FieldWriter(comm, tmp_path, {})
    writer.write_points(np.arange(3), np.zeros((3, 2)), np.ones(3), np.zeros(3))
    writer.frames = [(f"{step:06d}", step, 0.1 * step, {"damage": ()}) for step in range(10_000)]
    writer.write_frame(10_000, 1000.0, {"damage": np.zeros(3)})
    times = frame_times(tmp_path)
    assert len(times) == 10_001 and times[-1] == ("010000", 10_000, 1000.0) and read_frame(tmp_path)[1] == 10_000


def test_names_of_frames_are_no_paths(tmp_path, comm):
    """A damaged list does not lead to the removal of files elsewhere."""
    write(tmp_path / "out", comm)
    (tmp_path / "elsewhere.h5").write_text("of somebody else")
    with h5py.File(tmp_path / "out" / "fields.h5", "r+") as file:
        file["frames"].attrs["names"] = ["000000", "000007", "x/../../../elsewhere"]
    (tmp_path / "out" / "fields" / "frame_x").mkdir()
    with pytest.raises(OutputError, match="its fields cannot be continued .a frame whose name is not a number"):
        FieldWriter(comm, tmp_path / "out", {}).take_up(np.arange(5) * 10, 7)
    assert (tmp_path / "elsewhere.h5").exists()


def test_meshio_reads_every_frame(tmp_path, comm, monkeypatch):
    import meshio

    x = write(tmp_path, comm, 3)
    monkeypatch.chdir(tmp_path)
    with meshio.xdmf.TimeSeriesReader("fields.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert np.array_equal(points, x) and cells[0].type == "vertex" and len(cells[0].data) == 5
        assert reader.num_steps == 3
        time_, point_data, _ = reader.read_data(2)
        assert time_ == 1.0 and np.array_equal(point_data["displacement"], x + 2)


@pytest.mark.parametrize("kind, corners", [("quad", [[0, 1, 3, 2], [2, 3, 5, 4]]), ("triangle", [[0, 1, 2]]), ("tetra", [[0, 1, 2, 4]]), ("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]])])
def test_meshio_reads_the_cells_of_a_mesh(tmp_path, comm, monkeypatch, kind, corners):
    import meshio

    x = np.random.default_rng(0).random((8, 2 if kind in ("quad", "triangle") else 3))
    writer = FieldWriter(comm, tmp_path, {})
    writer.write_points(np.arange(8), x, np.ones(8), np.zeros(8), Cells(kind, np.array(corners)))
    writer.write_frame(1, 0.5, {"displacement": x})
    assert np.array_equal(read_points(tmp_path)["cells"], corners)
    monkeypatch.chdir(tmp_path)
    with meshio.xdmf.TimeSeriesReader("fields.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert np.array_equal(points[:, : x.shape[1]], x) and cells[0].type == kind and np.array_equal(cells[0].data, corners)
        assert np.array_equal(reader.read_data(0)[1]["displacement"][:, : x.shape[1]], x)


def test_an_unfinished_frame_is_not_seen(tmp_path, comm, monkeypatch):
    writer = FieldWriter(comm, tmp_path, {})
    writer.write_points(np.arange(2), np.zeros((2, 2)), np.ones(2), np.zeros(2))
    writer.write_frame(1, 0.1, {"damage": np.zeros(2)})

    def killed(part, path):
        raise KeyboardInterrupt

    monkeypatch.setattr(rows_file, "publish", killed)
    with pytest.raises(KeyboardInterrupt):
        writer.write_frame(2, 0.2, {"damage": np.ones(2)})
    assert [step for _, step, _ in frame_times(tmp_path)] == [1] and read_frame(tmp_path)[2]["damage"].tolist() == [0.0, 0.0]


def test_a_removed_folder_is_an_output_error(tmp_path, comm):
    import shutil

    writer = FieldWriter(comm, tmp_path / "out", {})
    writer.write_points(np.arange(2), np.zeros((2, 2)), np.ones(2), np.zeros(2))
    shutil.rmtree(tmp_path / "out")
    with pytest.raises(OutputError, match="cannot be written"):
        writer.write_frame(1, 0.1, {"damage": np.zeros(2)})


WRITER = """
import sys
import numpy as np
from mpi4py import MPI
from pdhpc.output.fields import FieldWriter
writer = FieldWriter(MPI.COMM_SELF, sys.argv[1], {})
n = 20000
writer.write_points(np.arange(n), np.zeros((n, 3)), np.ones(n), np.zeros(n))
print("ready", flush=True)
for step in range(1, 100000):
    writer.write_frame(step, step * 1.0, {"displacement": np.full((n, 3), float(step))})
"""


def test_killed_at_any_moment_all_finished_frames_are_readable(tmp_path):
    random = np.random.default_rng(0)
    for attempt in range(6):
        folder = tmp_path / str(attempt)
        child = subprocess.Popen([sys.executable, "-c", WRITER, str(folder)], stdout=subprocess.PIPE)
        child.stdout.readline()
        time.sleep(0.1 + 0.2 * random.random())
        os.kill(child.pid, signal.SIGKILL)
        child.wait()
        if not (folder / "fields.h5").exists():
            continue  # killed before the first frame was complete
        for index, (name, step, time_) in enumerate(frame_times(folder)):
            assert np.all(read_frame(folder, index)[2]["displacement"] == step)
    assert index >= 0
