"""Fields of all particles or vertices over time: one HDF5 file per frame, a master file that links them, and XDMF for ParaView.

    DIR/fields/points.h5        id, position, volume, block; topology of particles, cells of a mesh
    DIR/fields/frame_000012.h5  one dataset per field, attributes step and time
    DIR/fields.h5               external links /points and /frames/000012, the resolved scene as attribute
    DIR/fields.xdmf             the same for ParaView and meshio

Every file is written under another name and renamed when it is complete; the two small ones are written anew after each frame. So a kill at any moment
leaves all finished frames readable. Datasets are contiguous and uncompressed; each rank writes its own rows, in rank order: compare by `id`.
Vectors have three components, tensors nine, so that ParaView shows them in 2D too.
"""
import json
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.output.record import OutputError, refusal, unreadable, write_text
from pdhpc.output.rows_file import Rows, write_file, write_small
from pdhpc.output.xdmf import xdmf_text
from pdhpc.parallel.comm import agree_on_error, on_root
from pdhpc.parallel.travel import fetch_rows, send_rows


class Cells(NamedTuple):
    """Cells of a mesh for output: kind ("quad", ...); corners (n, corners) int64, rows of the vertices in points.h5, in VTK order."""

    kind: str
    corners: np.ndarray


class FieldWriter:
    """Writes the frames of one run; every method is Collective over `comm`."""

    def __init__(self, comm, directory, header):
        """header: dict with what every file carries: resolved scene, version, ranks."""
        self.comm, self.directory, self.header = comm, Path(directory), dict(header)
        self.frames, self._later = [], []  # (name, step, time, {field: components}); paths of frames that are not of this run any more
        self._points, self._cells, self._kind = Rows(0, 0, 0), Rows(0, 0, 0), None
        self._rows = None  # of this rank's points in the file, where they are not those of this rank's turn
        on_root(comm, _make_folder, self.directory / "fields")

    def write_points(self, id, position, volume, block, cells=None):
        """Write the particles, or the vertices of a mesh: id (n,) int64, position (n, dim) m, volume (n,) m^3, block (n,); cells : Cells of a mesh."""
        self._points, = Rows.of(self.comm, [len(id)])
        data = {"id": np.asarray(id, np.int64), "position": _wide(position), "volume": volume, "block": np.asarray(block, np.int32)}
        if cells is None:
            data["topology"] = np.arange(self._points.first, self._points.first + len(id), dtype=np.int64)[:, None]
        else:
            (self._cells,), self._kind = Rows.of(self.comm, [len(cells.corners)]), cells.kind
            data["cells"] = np.ascontiguousarray(cells.corners, np.int64)
        write_file(self.comm, self.directory / "fields" / "points.h5", data, {"dim": position.shape[1], "cell_kind": self._kind or ""})

    def write_frame(self, step, time, fields):
        """Write one frame: fields {name: (n,), (n, dim) or (n, dim, dim) array} of the same points in the same order as in write_points."""
        name = f"{step:06d}"
        data = {key: _wide(values) for key, values in fields.items()}
        if self._rows is not None:
            data = self._in_order(data)
        write_file(self.comm, self.directory / "fields" / f"frame_{name}.h5", data, {"step": step, "time": time})
        self.frames.append((name, step, time, {key: values.shape[1:] for key, values in data.items()}))
        on_root(self.comm, self._write_masters)

    def take_up(self, id, step):
        """Find the points and the frames up to `step` of a run, behind which `resume` goes on; return warnings, None without any fields.

        id (n,) int64, as given to write_points.

        Raises
        ------
        OutputError: the files of the run cannot be read, or hold other points; exit_code 2.
        """
        comm, found = self.comm, on_root(self.comm, _find, self.directory, step)
        if found is None:
            return None
        n_points = found.points
        self.frames, self._later, self._kind = found.frames, found.later, found.kind
        self._cells, self._points = Rows(0, 0, found.cells), Rows(0, 0, n_points)
        first, last = n_points * comm.rank // comm.size, n_points * (comm.rank + 1) // comm.size
        with agree_on_error(comm):
            there = _read_ids(self.directory, first, last)
        try:
            rows, = fetch_rows(comm, there, [np.arange(first, last)], np.asarray(id, np.int64))
        except KeyError:
            raise _unfit(self.directory, "they are of other points") from None
        mine, = Rows.of(comm, [len(id)])
        in_turn = np.array_equal(rows, np.arange(mine.first, mine.first + len(id)))
        self._rows = None if comm.allreduce(int(in_turn)) == comm.size else rows
        return found.warnings

    def resume(self):
        """Remove later frames than those that `take_up` found, and list these. Collective."""
        on_root(self.comm, self._write_masters)
        on_root(self.comm, _remove, self._later)

    def _in_order(self, data):
        """Return {key: rows} of this rank's share of the file's rows, in their order: ranks are other ones than those that wrote the points. Collective."""
        size, total = self.comm.size, self._points.total
        edges = total * np.arange(size + 1, dtype=np.int64) // size
        rows, *values = send_rows(self.comm, np.searchsorted(edges, self._rows, side="right") - 1, [self._rows, *data.values()])
        order = np.argsort(rows, kind="stable")
        return {key: each[order] for key, each in zip(data, values)}

    def _write_masters(self):
        """Write fields.h5 and fields.xdmf anew; rank 0."""
        write_small(self.directory / "fields.h5", self._fill_master)
        write_text(self.directory / "fields.xdmf", xdmf_text(self.frames, self._points.total, self._kind, self._cells.total))

    def _fill_master(self, file):
        """Put links to the frames and what every file carries into fields.h5."""
        import h5py

        for key, value in self.header.items():
            file.attrs[key] = value if isinstance(value, (str, int, float)) else json.dumps(value)
        file["points"] = h5py.ExternalLink("fields/points.h5", "/")
        frames = file.create_group("frames")
        for name, _, _, _ in self.frames:
            frames[name] = h5py.ExternalLink(f"fields/frame_{name}.h5", "/")
        frames.attrs["names"] = [name for name, _, _, _ in self.frames]
        frames.attrs["times"] = [time for _, _, time, _ in self.frames]
        frames.attrs["steps"] = [step for _, step, _, _ in self.frames]


def _wide(values):
    """Return vectors with three and tensors with nine components, contiguous; scalars as they are."""
    values = np.asarray(values)
    if values.ndim == 1:
        return np.ascontiguousarray(values)
    dim = values.shape[1]
    wide = np.zeros((len(values),) + (3,) * (values.ndim - 1))
    wide[(slice(None),) + (slice(0, dim),) * (values.ndim - 1)] = values
    return wide.reshape(len(values), 3 ** (values.ndim - 1))


def _make_folder(path):
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be created ({error.strerror})") from error


class Found(NamedTuple):
    """What a run has left: frames up to a step, as FieldWriter lists them; paths of the later ones; numbers of points and cells, and their kind; warnings."""

    frames: list
    later: list
    points: int
    cells: int
    kind: str
    warnings: list


def _find(directory, step):
    """Return the Found of a run, None without any fields; rank 0."""
    import h5py

    folder = directory / "fields"
    if not (directory / "fields.h5").exists() and not (folder / "points.h5").exists():
        return None
    with unreadable(partial(_unfit, directory)):
        with h5py.File(folder / "points.h5", "r") as file:
            points, cells = len(file["id"]), len(file["cells"]) if "cells" in file else 0
            kind = file.attrs["cell_kind"]
        kind = (kind.decode() if isinstance(kind, bytes) else kind) or None
        frames, later, lost = [], [], []
        for name, at, time in frame_times(directory):
            path = folder / f"frame_{name}.h5"
            if at > step:
                later.append(path)
            elif path.exists():
                with h5py.File(path, "r") as file:
                    frames.append((name, at, time, {key: dataset.shape[1:] for key, dataset in file.items()}))
            else:
                lost.append(path.name)
    warnings = [f"{folder}: {len(lost)} frames are not there any more ({lost[0]} and so on): they are left out"] if lost else []
    return Found(frames, later, points, cells, kind, warnings)


def _unfit(directory, why):
    return refusal(f"{directory}: its fields cannot be continued ({why}); allowed are fields.h5 and fields/ as the run left them, or none")


def _remove(paths):
    for path in paths:
        path.unlink(missing_ok=True)


def _read_ids(directory, first, last):
    import h5py

    with unreadable(partial(_unfit, directory)):
        with h5py.File(directory / "fields" / "points.h5", "r") as file:
            return np.asarray(file["id"][first:last], np.int64)


def read_points(directory):
    """Return {"id", "position" (n, dim), "volume", "block"} of a run's particles, and "cells" (m, corners) of a mesh. Local."""
    import h5py

    with h5py.File(Path(directory) / "fields" / "points.h5", "r") as file:
        points = {key: file[key][:] for key in ("id", "position", "volume", "block", "cells") if key in file}
        points["position"] = points["position"][:, : int(file.attrs["dim"])]
    return points


def frame_times(directory):
    """Return [(name, step, time)] of the complete frames of a run. Local."""
    import h5py

    with h5py.File(Path(directory) / "fields.h5", "r") as file:
        attributes = file["frames"].attrs
        names = [name if isinstance(name, str) else name.decode() for name in attributes["names"]]
        if not all(name.isdigit() for name in names):  # they become names of files
            raise ValueError("a frame whose name is not a number")
        return list(zip(names, (int(step) for step in attributes["steps"]), (float(time) for time in attributes["times"])))


def read_frame(directory, index=-1, names=None):
    """Return (time, step, {field: array}) of one frame; vectors and tensors as they are in the file, three and nine components. Local."""
    import h5py

    name, step, time = frame_times(directory)[index]
    with h5py.File(Path(directory) / "fields" / f"frame_{name}.h5", "r") as file:
        return time, step, {key: file[key][:] for key in (names or file.keys()) if key in file}
