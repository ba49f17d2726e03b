import json
import zlib
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from pdhpc import state
from pdhpc.output import checkpoint
from pdhpc.output.checkpoint import Damaged, generations, read_header, restore, write_checkpoint
from pdhpc.output.record import OutputError

IDS = np.array([4, 2, 7])


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    monkeypatch.setattr(checkpoint, "_PIECE", 2)


def entries():
    """(entries of every kind, what they hold)."""
    owner = SimpleNamespace(step=12, lost=0.25, kept=np.arange(6.0).reshape(3, 2), bits=np.array([[1], [2], [255]], np.uint8), chosen=np.array([True, False, True]), tip=np.array([1.0, np.nan]))
    made = {name: state.rows(getattr(owner, name), IDS) for name in ("kept", "bits", "chosen")}
    made["work"] = state.rows(np.array([1.0, 2.0]), state.SUM)
    return {**made, "step": state.number(owner, "step", int), "lost": state.number(owner, "lost", of=state.SUM), "tip": state.whole(owner.tip)}, owner


def write(comm, folder, step=12):
    saved, owner = entries()
    owner.step = step
    write_checkpoint(comm, folder, {"step": step, "dt": 1 / 3}, saved)
    return generations(folder)[0], owner


def test_what_is_written_comes_back_bit_for_bit(tmp_path, comm):
    path, owner = write(comm, tmp_path)
    fresh, other = entries()
    for array in (other.kept, other.bits, other.chosen, other.tip):
        array[...] = 0
    other.step, other.lost = 0, 0.0
    header = read_header(path)
    assert header["dt"] == 1 / 3 and header["step"] == 12 and header["ranks"] == 1
    restore(comm, path, header, fresh)
    for name, value in vars(owner).items():
        assert np.array_equal(getattr(other, name), value, equal_nan=name == "tip"), name
    assert other.chosen.dtype == bool and fresh["work"].get().tolist() == [1.0, 2.0]
    with h5py.File(path) as file:
        assert list(file["ids"]) == ["0"], "rows of the same points share their ids"
        assert len(file["pieces"]) == sum(-(-len(each) // 2) for each in (*file["state"].values(), file["ids/0"]))


def test_rows_are_found_by_their_points(tmp_path, comm):
    path, owner = write(comm, tmp_path)
    saved, other = entries()
    order = [2, 0, 1]
    for name in ("kept", "bits", "chosen"):
        saved[name] = saved[name]._replace(of=IDS[order])
    restore(comm, path, read_header(path), saved)
    assert other.kept.tolist() == owner.kept[order].tolist() and other.bits.tolist() == owner.bits[order].tolist()
    assert saved["work"].get().tolist() == [3.0, 0.0] and other.lost == 0.25, "sums are kept, whoever holds them"
    saved["kept"] = saved["kept"]._replace(of=np.array([4, 2, 8]))
    with pytest.raises(Damaged, match="no state of point 8"):
        restore(comm, path, read_header(path), saved)


def test_two_generations_are_kept(tmp_path, comm):
    for step in (5, 90, 1000):
        write(comm, tmp_path, step)
    assert [read_header(path)["step"] for path in generations(tmp_path)] == [1000, 90]


def test_every_flipped_bit_of_the_data_is_seen(tmp_path, comm):
    path, _ = write(comm, tmp_path)
    whole, header = path.read_bytes(), read_header(path)
    with h5py.File(path) as file:
        places = [(file[name].id.get_offset(), file[name].id.get_storage_size()) for name in ("state/kept", "state/bits", "state/step", "ids/0")]
    random = np.random.default_rng(0)
    for offset, size in places:
        damaged = bytearray(whole)
        damaged[offset + random.integers(size)] ^= 1 << random.integers(8)
        path.write_bytes(damaged)
        with pytest.raises(Damaged, match="do not match their checksum"):
            restore(comm, path, header, entries()[0])


def test_a_damaged_one_is_named_once(tmp_path, comm):
    path, _ = write(comm, tmp_path)
    with h5py.File(path, "r+") as file:
        file.attrs["header_crc"] = 1
    with pytest.raises(Damaged) as caught:
        read_header(path)
    assert str(caught.value) == f"{path}: damaged: its header does not match its checksum"


def test_files_that_are_cut_or_changed_are_damaged(tmp_path, comm):
    path, _ = write(comm, tmp_path)
    whole, header = path.read_bytes(), read_header(path)
    at = whole.index(b'"step"')
    path.write_bytes(whole[:at] + b'"stop"' + whole[at + 6 :])
    with pytest.raises(Damaged, match="header does not match its checksum"):
        read_header(path)
    for share in (0.0, 0.3, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(Damaged, match="damaged"):
            restore(comm, path, header, entries()[0])
    path.write_bytes(whole)
    with h5py.File(path, "r+") as file:
        text = json.dumps({**header, "format": 99})
        file.attrs["header"], file.attrs["header_crc"] = text, zlib.crc32(text.encode())
    with pytest.raises(Damaged, match="format 99; allowed is 1"):
        read_header(path)


def test_state_of_another_kind_of_scene_is_refused(tmp_path, comm):
    path, _ = write(comm, tmp_path)
    saved, _ = entries()
    del saved["bits"]
    with pytest.raises(Damaged, match="state of bits is not that of this scene"):
        restore(comm, path, read_header(path), saved)
    saved, owner = entries()
    saved["kept"] = state.rows(np.zeros(3), IDS)
    with pytest.raises(Damaged, match="state of kept has another shape"):
        restore(comm, path, read_header(path), saved)


def test_a_folder_that_cannot_be_written(tmp_path, comm):
    (tmp_path / "checkpoint").write_text("")
    with pytest.raises(OutputError, match="checkpoint: cannot be created"):
        write(comm, tmp_path)
