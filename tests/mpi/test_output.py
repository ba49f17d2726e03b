"""Frames written by several ranks, one of them without particles; errors that every rank sees."""
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest

from pdhpc.output import rows_file
from pdhpc.output.fields import FieldWriter, read_frame, read_points
from pdhpc.output.record import OutputError


@pytest.fixture
def folder(comm):
    path = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    yield Path(path)
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(path, ignore_errors=True)


def write(comm, folder):
    n = 0 if comm.rank == comm.size - 1 else 3 + comm.rank
    ids = 100 * comm.rank + np.arange(n)
    writer = FieldWriter(comm, folder, {})
    writer.write_points(ids, np.stack([ids, -ids], axis=1).astype(float), np.ones(n), np.zeros(n))
    writer.write_frame(4, 0.5, {"damage": ids / 7, "displacement": np.stack([ids, 2.0 * ids], axis=1)})
    comm.Barrier()
    points, (time, step, data) = read_points(folder), read_frame(folder)
    expected = np.concatenate([100 * rank + np.arange(3 + rank) for rank in range(comm.size - 1)])
    assert np.array_equal(np.sort(points["id"]), expected) and (time, step) == (0.5, 4)
    assert np.array_equal(data["damage"], points["id"] / 7) and np.array_equal(data["displacement"][:, 1], 2.0 * points["id"])
    return writer


@pytest.mark.mpi(min_size=2)
def test_every_rank_writes_its_rows(comm, folder):
    write(comm, folder)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("failing", ["pwrite", "fsync"])
def test_every_rank_hears_that_one_could_not_write(comm, folder, monkeypatch, failing):
    def full(*words):
        raise OSError(28, "No space left on device")

    writer = write(comm, folder)
    with monkeypatch.context() as here:
        if comm.rank == 1:
            here.setattr(rows_file.os, failing, full)
        with pytest.raises(OutputError, match="frame_000005.h5: cannot be written .No space left on device"):
            writer.write_frame(5, 0.6, {"damage": np.zeros(0 if comm.rank == comm.size - 1 and failing == "fsync" else 3 + comm.rank)})
    comm.Barrier()
    assert sorted(path.name for path in (folder / "fields").iterdir()) == ["frame_000004.h5", "points.h5"]


@pytest.mark.mpi(min_size=2)
def test_every_rank_raises_when_the_folder_is_gone(comm, folder):
    writer = write(comm, folder / "out")
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(folder / "out")
    comm.Barrier()
    with pytest.raises(OutputError, match="cannot be written"):
        writer.write_frame(5, 0.6, {"damage": np.zeros(5)})
