"""Checkpoints: all of a run's state in one file that ranks write together, from which it continues on any number of ranks.

    DIR/checkpoint/step_000120.h5    attribute header (JSON: scene and the place of its file, step, time, ranks, versions), with its CRC-32
        state/KEY                    rows of an entry, in rank order; the bytes of bond states, a bit each
        ids/K                        global ids of the points of those rows, once for all entries that share them
        ranks (n_ranks, ...)         for each rank that wrote: its first row and number of rows in each dataset, its first piece and number of pieces; their CRC-32
        pieces (n_pieces, 4)         dataset, first row, rows and CRC-32 of them

A file is written under another name and renamed when it is complete, and the two newest are kept: a kill at any moment leaves one that can be read. Every
byte that is read is checked against its CRC-32. Reading on as many ranks as wrote, each rank reads its own rows; on another number each reads what some of
the writers wrote, and rows travel to the ranks that have the points now.
"""
import json
import zlib
from pathlib import Path

import numpy as np

from pdhpc.output.record import OutputError, plain, unreadable
from pdhpc.output.rows_file import Rows, write_file
from pdhpc.parallel.comm import agree_on_error, largest, on_root
from pdhpc.parallel.travel import fetch_rows
from pdhpc.state import EVERYWHERE, SUM

FOLDER = "checkpoint"
KEPT = 2
"""Generations."""
FORMAT = 1
_PIECE = 1 << 16  # rows under one checksum


class Damaged(OutputError):
    """A checkpoint that cannot be trusted: one sentence with the reason."""

    exit_code = 2


def write_checkpoint(comm, directory, header, entries):
    """Write a checkpoint into DIR/checkpoint and remove all but the two newest. Collective.

    Parameters
    ----------
    header : dict with "step" (int) and whatever JSON can hold. entries : {key: Entry}, the same keys on every rank.

    Raises
    ------
    OutputError: on every rank; what was there before can still be read.
    """
    folder = Path(directory) / FOLDER
    on_root(comm, _make_folder, folder)
    groups = _groups(comm, entries)
    data, kinds = {}, {}
    for key, entry in entries.items():
        values, shared = np.asarray(entry.get()), isinstance(entry.of, str) and entry.of == EVERYWHERE
        kind = {"of": entry.of if isinstance(entry.of, str) else groups[key], "scalar": values.ndim == 0, "bool": values.dtype == bool}
        values = values.reshape(1) if values.ndim == 0 else values
        values = values.astype(np.uint8) if values.dtype == bool else values
        data[f"state/{key}"] = values = _of_one_width(comm, values[: 0 if shared and comm.rank else len(values)])
        kinds[key] = {**kind, "dtype": values.dtype.str, "tail": values.shape[1:]}
    for key, number in groups.items():
        if f"ids/{number}" not in data:
            data[f"ids/{number}"] = np.ascontiguousarray(entries[key].of, np.int64)
    text = json.dumps(plain({**header, "format": FORMAT, "ranks": comm.size, "kinds": kinds}))
    attributes = {"header": text, "header_crc": zlib.crc32(text.encode())}
    write_file(comm, folder / f"step_{header['step']:09d}.h5", {**data, **_tables(comm, data)}, attributes)
    on_root(comm, _prune, folder)


def _groups(comm, entries):
    """Return {key: number} of entries by rows: those with the same ids on every rank have the same number. Collective."""
    from mpi4py import MPI

    keys = [key for key, entry in entries.items() if not isinstance(entry.of, str)]
    same = np.array([[np.array_equal(entries[a].of, entries[b].of) for b in keys] for a in keys], np.uint8).reshape(len(keys), len(keys))
    comm.Allreduce(MPI.IN_PLACE, same, MPI.MIN)
    return {key: int(np.argmax(same[row])) for row, key in enumerate(keys)}


def _of_one_width(comm, values):
    """Return rows as wide as the widest of any rank, with zeros at the end: bytes of bond states are as many as a rank's largest family needs. Collective."""
    if values.ndim < 2:
        return np.ascontiguousarray(values)
    width = largest(comm, values.shape[1])
    if width == values.shape[1]:
        return np.ascontiguousarray(values)
    wide = np.zeros((len(values), width, *values.shape[2:]), values.dtype)
    wide[:, : values.shape[1]] = values
    return wide


def _tables(comm, data):
    """Return {"ranks", "pieces"}. Collective."""
    rows, pieces = Rows.of(comm, [len(values) for values in data.values()]), []
    for number, (values, mine) in enumerate(zip(data.values(), rows)):
        for start in range(0, mine.count, _PIECE):
            piece = values[start : start + _PIECE]
            pieces.append((number, mine.first + start, len(piece), zlib.crc32(piece)))
    own, = Rows.of(comm, [len(pieces)])
    place = np.array([each for mine in (*rows, own) for each in (mine.first, mine.count)], np.int64)
    return {"ranks": np.append(place, zlib.crc32(place))[None], "pieces": np.array(pieces, np.int64).reshape(-1, 4)}


def _make_folder(folder):
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be created ({error.strerror})") from error


def _prune(folder):
    for path in generations(folder.parent)[KEPT:]:
        path.unlink(missing_ok=True)


def generations(directory):
    """Return the paths of a run's checkpoints, the newest first. Local."""
    return sorted((Path(directory) / FOLDER).glob("step_*.h5"), reverse=True)


def read_header(path):
    """Return the header of a checkpoint. Local.

    Raises
    ------
    Damaged.
    """
    import h5py

    with unreadable(lambda why: Damaged(f"{path}: damaged: {why}")):
        with h5py.File(path, "r") as file:
            text, crc = file.attrs["header"], int(file.attrs["header_crc"])
        text = text.decode() if isinstance(text, bytes) else text
        if zlib.crc32(text.encode()) != crc:
            raise Damaged(f"{path}: damaged: its header does not match its checksum")
        header = json.loads(text)
    if header.get("format") != FORMAT:
        raise Damaged(f"{path}: format {header.get('format')}; allowed is {FORMAT}, that of this version of pdhpc")
    return header


def restore(comm, path, header, entries):
    """Set the entries of a run as a checkpoint has them. Collective.

    Raises
    ------
    Damaged: on every rank; entries may be set in part.
    """
    missing = sorted(set(entries) ^ set(header["kinds"]))
    if missing:
        raise Damaged(f"{path}: state of {missing[0]} is not that of this scene")
    names = {f"state/{key}": (kind["dtype"], tuple(kind["tail"])) for key, kind in header["kinds"].items()}
    names.update({f"ids/{kind['of']}": ("<i8", ()) for kind in header["kinds"].values() if not isinstance(kind["of"], str)})
    found = {}
    with agree_on_error(comm):
        found = _read(comm, path, header["ranks"], names)
    own = header["ranks"] == comm.size and _are_own(comm, found, header["kinds"], entries)
    with agree_on_error(comm):
        _check_kinds(path, found, header["kinds"], entries)
    for key, entry in entries.items():
        kind, values = header["kinds"][key], found[f"state/{key}"]
        if kind["of"] == EVERYWHERE:
            values = comm.bcast(values)  # of rank 0, which has read them
        elif kind["of"] == SUM:
            values = values if own else _moved_sum(comm, values, entry.get())
        elif not own:
            try:
                values, = fetch_rows(comm, found[f"ids/{kind['of']}"], [values], np.asarray(entry.of, np.int64))
            except KeyError as error:
                raise Damaged(f"{path}: there is no state of point {error.args[0]}: it belongs to another scene") from None
        values = values.astype(bool) if kind["bool"] else values
        entry.set(values[0] if kind["scalar"] else values)


def _read(comm, path, writers, names):
    """Return {name: rows} that this rank reads: its own, or those of the writers whose rows it takes; names : {name: (dtype, shape of a row)}. Local."""
    import h5py

    first, last = (-(-writers * rank // comm.size) for rank in (comm.rank, comm.rank + 1))  # rank 0 always has the first
    with unreadable(lambda why: Damaged(f"{path}: damaged: {why}")):
        with h5py.File(path, "r") as file:
            ranks = _checked_ranks(path, file["ranks"], first, last, 2 * len(names) + 3)
            begin, end = (ranks[0, -2], ranks[-1, -2:].sum()) if last > first else (0, 0)
            pieces = file["pieces"][int(begin) : int(end)]
            found = {}
            for number, (name, kind) in enumerate(names.items()):
                dataset = file[name]
                if (dataset.dtype.str, dataset.shape[1:]) != kind:
                    raise Damaged(f"{path}: damaged: {name} is of another kind than its header says")
                start, stop = (int(ranks[0, 2 * number]), int(ranks[-1, 2 * number : 2 * number + 2].sum())) if last > first else (0, 0)
                values = np.empty((stop - start, *dataset.shape[1:]), dataset.dtype)
                if values.size:
                    dataset.read_direct(values, np.s_[start:stop], np.s_[:])
                _check_pieces(path, name, values, start, pieces[pieces[:, 0] == number])
                found[name] = values
    return found


def _checked_ranks(path, dataset, first, last, width):
    """Return the rows of the writers first to last - 1, without their checksums, which are right."""
    if dataset.shape[1:] != (width,):
        raise Damaged(f"{path}: damaged: its table of ranks is of another width")
    ranks = dataset[first:last]
    if len(ranks) != last - first or any(zlib.crc32(np.ascontiguousarray(row[:-1])) != row[-1] for row in ranks):
        raise Damaged(f"{path}: damaged: its table of ranks does not match its checksum")
    return ranks[:, :-1]


def _check_pieces(path, name, values, start, pieces):
    """Raise Damaged unless pieces (n, 4) cover the rows and every checksum is right."""
    at = start
    for _, first, count, crc in pieces.tolist():
        if first != at or count < 1 or zlib.crc32(values[first - start : first - start + count]) != crc:
            raise Damaged(f"{path}: damaged: rows {first} to {first + count} of {name} do not match their checksum")
        at += count
    if at != start + len(values):
        raise Damaged(f"{path}: damaged: rows of {name} have no checksum")


def _are_own(comm, found, kinds, entries):
    """Whether every rank has read the rows of its own points, in their order. Collective."""
    same = all(isinstance(entry.of, str) or np.array_equal(found[f"ids/{kinds[key]['of']}"], entry.of) for key, entry in entries.items())
    same = same and all(kinds[key]["of"] != SUM or len(np.atleast_1d(entry.get())) == len(found[f"state/{key}"]) for key, entry in entries.items())
    return bool(comm.allreduce(int(same)) == comm.size)


def _check_kinds(path, found, kinds, entries):
    """Raise Damaged where an entry has another shape here. Local."""
    for key, entry in entries.items():
        here, there = np.asarray(entry.get()), found[f"state/{key}"]
        tail = there.shape[1:] if not kinds[key]["scalar"] else ()
        if kinds[key]["of"] != EVERYWHERE and here.ndim != there.ndim - kinds[key]["scalar"] or here.ndim > 2 and here.shape[1:] != tail:
            raise Damaged(f"{path}: state of {key} has another shape than this scene gives it")


def _moved_sum(comm, values, here):
    """Return rows of the shape of `here` that add up, over all ranks, to what all the values do. Collective."""
    here = np.asarray(here)
    total = comm.allreduce(values.sum(axis=0))
    moved = np.zeros(here.shape if here.ndim else (1,), values.dtype)
    with_rows = [rank for rank, n in enumerate(comm.allgather(len(moved))) if n]
    if with_rows and with_rows[0] == comm.rank:
        moved[0] = total
    return moved
