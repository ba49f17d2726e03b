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
import os
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.output.record import OutputError, write_text
from pdhpc.output.xdmf import xdmf_text
from pdhpc.parallel.comm import on_root


class Cells(NamedTuple):
    """Cells of a mesh for output: kind ("quad", ...); corners (n, corners) int64, rows of the vertices in points.h5, in VTK order."""

    kind: str
    corners: np.ndarray


class Rows(NamedTuple):
    """This rank's rows of a dataset: the first, their number, and the number of all."""

    first: int
    count: int
    total: int

    @classmethod
    def of(cls, comm, count):
        """Return the Rows of a rank that has `count`. Collective."""
        counts = comm.allgather(count)
        return cls(sum(counts[: comm.rank]), count, sum(counts))


class FieldWriter:
    """Writes the frames of one run; every method is Collective over `comm`."""

    def __init__(self, comm, directory, header):
        """header: dict with what every file carries: resolved scene, version, ranks."""
        self.comm, self.directory, self.header = comm, Path(directory), dict(header)
        self.frames = []  # (name, step, time, {field: components})
        self._points, self._cells, self._kind = Rows(0, 0, 0), Rows(0, 0, 0), None
        on_root(comm, _make_folder, self.directory / "fields")

    def write_points(self, id, position, volume, block, cells=None):
        """Write the particles, or the vertices of a mesh: id (n,) int64, position (n, dim) m, volume (n,) m^3, block (n,); cells : Cells of a mesh."""
        self._points = Rows.of(self.comm, len(id))
        data = {"id": np.asarray(id, np.int64), "position": _wide(position), "volume": volume, "block": np.asarray(block, np.int32)}
        if cells is None:
            data["topology"] = np.arange(self._points.first, self._points.first + len(id), dtype=np.int64)[:, None]
        else:
            self._cells, self._kind = Rows.of(self.comm, len(cells.corners)), cells.kind
            data["cells"] = np.ascontiguousarray(cells.corners, np.int64)
        self._write_file("points.h5", data, {"dim": position.shape[1], "cell_kind": self._kind or ""})

    def write_frame(self, step, time, fields):
        """Write one frame: fields {name: (n,), (n, dim) or (n, dim, dim) array} of the same points in the same order as in write_points."""
        name = f"{step:06d}"
        data = {key: _wide(values) for key, values in fields.items()}
        self._write_file(f"frame_{name}.h5", data, {"step": step, "time": time})
        self.frames.append((name, step, time, {key: values.shape[1:] for key, values in data.items()}))
        on_root(self.comm, self._write_masters)

    def _write_file(self, name, data, attributes):
        """Write datasets by rows of all ranks into fields/NAME, complete or not at all; the same OutputError on every rank."""
        path = self.directory / "fields" / name
        part = path.with_name(name + ".part")
        write = self._write_together if _parallel_h5py() and self.comm.size > 1 else self._write_in_turn
        error = write(part, data, attributes)
        errors = [each for each in self.comm.allgather(error) if each is not None]
        if errors:
            raise OutputError(f"{path}: cannot be written ({errors[0]})")
        on_root(self.comm, _publish, part, path)

    def _write_together(self, part, data, attributes):
        """Write with parallel HDF5; return what went wrong, or None."""
        import h5py

        on_root(self.comm, _touch, part)
        try:
            with h5py.File(part, "w", driver="mpio", comm=self.comm) as file:
                self._create(file, data, attributes)
                for key, values in data.items():
                    _write_rows(file[key], self._rows(key).first, values)
        except (OSError, RuntimeError, ValueError) as error:
            return _reason(error)
        return None

    def _write_in_turn(self, part, data, attributes):
        """Write one rank after the other, for an h5py without MPI; return what went wrong, or None."""
        import h5py

        if self.comm.size > 1 and self.comm.rank == 0 and not self.frames:
            warnings.warn("this h5py is built without MPI: ranks write their fields one after the other", stacklevel=2)
        error = None
        for rank in range(self.comm.size):
            if rank == self.comm.rank:
                try:
                    with h5py.File(part, "w" if rank == 0 else "r+") as file:
                        if rank == 0:
                            self._create(file, data, attributes)
                        for key, values in data.items():
                            rows = self._rows(key)
                            file[key][rows.first : rows.first + rows.count] = values
                except (OSError, RuntimeError, KeyError) as caught:
                    error = _reason(caught)
            self.comm.Barrier()
        return error

    def _rows(self, key):
        return self._cells if key == "cells" else self._points

    def _create(self, file, data, attributes):
        for key, values in data.items():
            file.create_dataset(key, shape=(self._rows(key).total,) + values.shape[1:], dtype=values.dtype)
        for key, value in attributes.items():
            file.attrs[key] = value

    def _write_masters(self):
        """Write fields.h5 and fields.xdmf anew; rank 0."""
        import h5py

        path = self.directory / "fields.h5"
        part = path.with_name(path.name + ".part")
        try:
            with h5py.File(part, "w") as file:
                for key, value in self.header.items():
                    file.attrs[key] = value if isinstance(value, (str, int, float)) else json.dumps(value)
                file["points"] = h5py.ExternalLink("fields/points.h5", "/")
                frames = file.create_group("frames")
                for name, _, _, _ in self.frames:
                    frames[name] = h5py.ExternalLink(f"fields/frame_{name}.h5", "/")
                frames.attrs["names"] = [name for name, _, _, _ in self.frames]
                frames.attrs["times"] = [time for _, _, time, _ in self.frames]
                frames.attrs["steps"] = [step for _, step, _, _ in self.frames]
            _publish(part, path)
        except (OSError, RuntimeError) as error:
            raise OutputError(f"{path}: cannot be written ({_reason(error)})") from error
        write_text(self.directory / "fields.xdmf", xdmf_text(self.frames, self._points.total, self._kind, self._cells.total))


def _write_rows(dataset, first, values):
    """Write the rows of this rank, collectively with all others: a rank without rows selects nothing, but must take part, or the others wait for ever."""
    from h5py import h5fd, h5p, h5s

    memory = h5s.create_simple((max(1, len(values)),) + values.shape[1:])
    target = dataset.id.get_space()
    if len(values):
        target.select_hyperslab((first,) + (0,) * (values.ndim - 1), values.shape)
    else:
        memory.select_none()
        target.select_none()
        values = np.zeros((1,) + values.shape[1:], values.dtype)
    transfer = h5p.create(h5p.DATASET_XFER)
    transfer.set_dxpl_mpio(h5fd.MPIO_COLLECTIVE)
    dataset.id.write(memory, target, values, dxpl=transfer)


def _wide(values):
    """Return vectors with three and tensors with nine components, contiguous; scalars as they are."""
    values = np.asarray(values)
    if values.ndim == 1:
        return np.ascontiguousarray(values)
    dim = values.shape[1]
    wide = np.zeros((len(values),) + (3,) * (values.ndim - 1))
    wide[(slice(None),) + (slice(0, dim),) * (values.ndim - 1)] = values
    return wide.reshape(len(values), 3 ** (values.ndim - 1))


def _parallel_h5py():
    import h5py

    return h5py.get_config().mpi


def _reason(error):
    return getattr(error, "strerror", None) or str(error).splitlines()[0]


def _make_folder(path):
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be created ({error.strerror})") from error


def _touch(path):
    """Try to create a file with plain system calls first: their errors say more than those of parallel HDF5."""
    try:
        with open(path, "wb"):
            pass
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def _publish(part, path):
    """Give a complete file its name."""
    try:
        with open(part, "rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


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
        return list(zip(names, (int(step) for step in attributes["steps"]), (float(time) for time in attributes["times"])))


def read_frame(directory, index=-1, names=None):
    """Return (time, step, {field: array}) of one frame; vectors and tensors as they are in the file, three and nine components. Local."""
    import h5py

    name, step, time = frame_times(directory)[index]
    with h5py.File(Path(directory) / "fields" / f"frame_{name}.h5", "r") as file:
        return time, step, {key: file[key][:] for key in (names or file.keys()) if key in file}
