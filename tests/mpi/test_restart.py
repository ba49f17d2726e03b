"""Runs that go on, on as many ranks as before and on others."""
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest

from pdhpc.output.checkpoint import generations, read_header, restore, write_checkpoint
from pdhpc.output.fields import frame_times, read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.output.record import OutputError
from pdhpc.parallel.comm import on_root
from pdhpc.parallel.travel import fetch_rows
from pdhpc.restart import find, scene_of
from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.state import EVERYWHERE, SUM, Entry
from pdhpc.study.verify.fracture import GROWING_CRACK
from tests.going_on import CASES, ON_RANKS, answer, close, resume, run, same, same_record


@pytest.fixture
def folder(comm):
    path = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    yield Path(path)
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(path, ignore_errors=True)


def group(comm, size):
    """The first `size` ranks; None on the others."""
    from mpi4py import MPI

    part = comm.Split(0 if comm.rank < size else MPI.UNDEFINED, comm.rank)
    return part if comm.rank < size else None


@pytest.mark.mpi(min_size=2)
def test_rows_are_fetched_by_their_ids(comm):
    mine = np.arange(comm.rank, 40, comm.size, dtype=np.int64)[::-1]
    wanted = np.random.default_rng(comm.rank).choice(40, 5 * comm.rank, replace=False).astype(np.int64)
    squares, pairs = fetch_rows(comm, mine, [mine**2, np.stack([mine, -mine], axis=1)], wanted)
    assert np.array_equal(squares, wanted**2) and np.array_equal(pairs, np.stack([wanted, -wanted], axis=1))
    with pytest.raises(KeyError, match="99"):
        fetch_rows(comm, mine, [mine], np.array([99] if comm.rank else [1]))


def entries(comm, kept, ids, sums):
    """Entries of every kind, and what they hold."""
    held = {"kept": kept, "sums": sums, "number": 0.0}
    made = {"kept": Entry(lambda: held["kept"], lambda value: held.update(kept=value), ids), "sums": Entry(lambda: held["sums"], lambda value: held.update(sums=value), SUM)}
    return {**made, "number": Entry(lambda: held["number"], lambda value: held.update(number=value), EVERYWHERE)}, held


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("writers, readers", [(1, None), (None, 1), (None, None)])
def test_state_moves_to_other_ranks(comm, folder, writers, readers):
    """Rows of bond states are wider where families are larger: the widest counts. A rank may have no rows."""
    writers, readers = writers or comm.size, readers or comm.size
    part = group(comm, writers)
    if part is not None:
        ids = np.arange(part.rank, 30, part.size, dtype=np.int64) if part.rank or part.size == 1 else np.empty(0, np.int64)
        made, held = entries(part, np.stack([ids, 2 * ids], axis=1)[:, : 2 if part.rank + 1 == part.size else 1].astype(np.uint8), ids, np.full(1 + part.rank, 1.5))
        held["number"] = 7.25 if part.rank == 0 else 0.0
        write_checkpoint(part, folder, {"step": 3}, made)
    comm.Barrier()
    part = group(comm, readers)
    if part is not None:
        every = np.arange(30) if writers == 1 else np.concatenate([np.arange(rank, 30, writers) for rank in range(1, writers)])
        ids = np.sort(every)[part.rank :: part.size][::-1].astype(np.int64)
        made, held = entries(part, np.zeros((len(ids), 2), np.uint8), ids, np.zeros(2))
        path = generations(folder)[0]
        restore(part, path, read_header(path), made)
        widest = ids % writers == writers - 1
        assert np.array_equal(held["kept"][:, 0], ids) and np.array_equal(held["kept"][widest, 1], 2 * ids[widest]) and not held["kept"][~widest, 1].any()
        assert held["number"] == 7.25 and part.allreduce(held["sums"].sum()) == 1.5 * writers * (writers + 1) / 2
    comm.Barrier()


@pytest.mark.mpi(min_size=2)
def test_a_damaged_file_is_heard_of_everywhere(comm, folder):
    made, _ = entries(comm, np.full((4, 1), comm.rank, np.uint8), np.arange(4) + 4 * comm.rank, np.zeros(1))
    write_checkpoint(comm, folder, {"step": 3}, made)
    path = generations(folder)[0]
    header = on_root(comm, read_header, path)  # HDF5 lets nobody write while another reads

    def damage():
        import h5py

        with h5py.File(path, "r+") as file:
            file["state/kept"][4 * comm.size - 1] = 99

    on_root(comm, damage)
    with pytest.raises(OutputError, match="do not match their checksum"):
        restore(comm, path, header, made)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, before, after", [("lattice", None, None), ("lattice", 1, None), ("lattice", None, 1), ("cloud", 1, None), ("cloud", None, 1)])
def test_a_crack_goes_on_bit_for_bit(comm, folder, path, before, after):
    words = ["time.end=14e-6", "output.frames=4", "tip.crack.window=2e-6", f"particles.path={path}", "checkpoint.at_end=false"]
    scene = parse_scene(GROWING_CRACK + "\n[checkpoint]\n", "crack", [*words, "checkpoint.steps=50"])
    for size, out in ((comm.size, folder / "whole"), (before or comm.size, folder / "stopped")):
        part = group(comm, size)
        if part is not None:
            record = Simulation(scene, part).run(out, quiet=True)
            assert record["broken_bonds"] > 100
        comm.Barrier()
    part = group(comm, after or comm.size)
    if part is not None:
        saved = on_root(part, find, folder / "stopped")
        assert saved[0].header["step"] < record["steps"]
        Simulation(scene_of(saved[0], folder, ()), part).resume(folder / "stopped", saved, quiet=True)
    comm.Barrier()
    if comm.rank == 0:
        order = [np.argsort(read_points(folder / out)["id"]) for out in ("whole", "stopped")]
        assert frame_times(folder / "whole") == frame_times(folder / "stopped")
        for frame in range(len(frame_times(folder / "whole"))):
            one, other = (read_frame(folder / out, frame)[2] for out in ("whole", "stopped"))
            assert all(np.array_equal(one[name][order[0]], other[name][order[1]]) for name in one), frame
        one, other = (read_history(folder / out / "history.csv") for out in ("whole", "stopped"))
        assert all(np.array_equal(one[column], other[column], equal_nan=True) for column in one)
    comm.Barrier()


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("name", ON_RANKS)
def test_every_method_goes_on(comm, folder, name):
    """As if it had not been stopped, digit for digit, on as many ranks; on one, as far as it depends on the number of ranks at all."""
    case = CASES[name]
    record = run(case, comm, folder)
    whole = on_root(comm, answer, folder)
    at_step = np.searchsorted(whole.history["step"], case.step)
    assert (whole.history["broken_bonds"][-1] > whole.history["broken_bonds"][at_step]) == case.breaks
    again = resume(case, comm, folder)
    same(on_root(comm, answer, folder), whole)
    same_record(again, record)
    alone = group(comm, 1)
    if alone is not None:
        resume(case, alone, folder)
        close(answer(folder), whole, case.elsewhere)
    comm.Barrier()
