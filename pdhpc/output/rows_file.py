"""HDF5 files that ranks write together, each its own rows of every dataset, complete or not at all."""
import contextlib
import io
import os
from typing import NamedTuple

import numpy as np

from pdhpc.output.record import OutputError, part_name, part_of, reason
from pdhpc.parallel.comm import on_root

_OVERHEAD = 1 << 16  # bytes of HDF5 beside the data, at most about


class Rows(NamedTuple):
    """This rank's rows of a dataset: the first, their number, and the number of all."""

    first: int
    count: int
    total: int

    @classmethod
    def of(cls, comm, counts):
        """Return [Rows] of datasets of which this rank has `counts` rows. Collective."""
        from mpi4py import MPI

        mine, ends, totals = np.asarray(counts, np.int64), np.zeros(len(counts), np.int64), np.zeros(len(counts), np.int64)
        comm.Scan(mine, ends, MPI.SUM)
        comm.Allreduce(mine, totals, MPI.SUM)
        return [cls(*(int(each) for each in row)) for row in zip(ends - mine, mine, totals)]


def write_file(comm, path, data, attributes):
    """Write a file under another name and rename it when it is complete. Collective.

    Datasets are contiguous and uncompressed; rows lie in rank order. HDF5 makes the file without its rows, on rank 0; each rank then puts its rows where they
    belong with plain system calls. These say what goes wrong, on the rank where it does: HDF5 does not survive a write that fails, and with MPI leaves ranks waiting.

    Parameters
    ----------
    data : {name: (n, ...) array}, this rank's rows, of the same kinds on every rank. attributes : {name: value} of the file, those of rank 0 count.

    Raises
    ------
    OutputError: on every rank, with the reason.
    """
    part, size = part_name(path), comm.allreduce(sum(values.nbytes for values in data.values()))
    rows = dict(zip(data, Rows.of(comm, [len(values) for values in data.values()])))
    kinds = {name: ((rows[name].total, *values.shape[1:]), values.dtype) for name, values in data.items()}
    places = on_root(comm, _outline, path, part, kinds, attributes, size)
    errors = [each for each in comm.allgather(_fill(part, data, rows, places)) if each is not None]
    if errors:
        on_root(comm, _remove, part)
        raise OutputError(f"{path}: cannot be written ({errors[0]})")
    on_root(comm, publish, part, path)


def _outline(path, part, kinds, attributes, size):
    """Make a file of datasets {name: (shape, dtype)} without their rows, and return {name: byte at which they begin}."""
    import h5py

    try:
        part_of(path)
        _make_room(path, part, size, sum(len(str(value)) for value in attributes.values()))
        with h5py.File(part, "w") as file:
            file.attrs.update(attributes)
            return {name: _add_dataset(file, name, *kind) for name, kind in kinds.items()}
    except (OSError, RuntimeError, ValueError) as error:
        _remove(part)
        raise OutputError(f"{path}: cannot be written ({reason(error)})") from error


def _add_dataset(file, name, shape, dtype):
    """Add a dataset that has its place in the file, to which nothing is written; return its first byte, None without any rows."""
    from h5py import h5d, h5p, h5s, h5t

    kind, link = h5p.create(h5p.DATASET_CREATE), h5p.create(h5p.LINK_CREATE)
    kind.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    kind.set_fill_time(h5d.FILL_TIME_NEVER)
    link.set_create_intermediate_group(True)
    return h5d.create(file.id, name.encode(), h5t.py_create(dtype, logical=True), h5s.create_simple(shape), dcpl=kind, lcpl=link).get_offset()


def _fill(part, data, rows, places):
    """Write this rank's rows to their places; return what went wrong, or None. Local."""
    try:
        file = os.open(part, os.O_WRONLY)
        try:
            for name, values in data.items():
                content = np.ascontiguousarray(values).reshape(-1).view(np.uint8)
                at = (places[name] or 0) + rows[name].first * (len(content) // max(len(values), 1))
                while len(content):
                    written = os.pwrite(file, content, at)
                    content, at = content[written:], at + written
            os.fsync(file)
        finally:
            os.close(file)
    except OSError as error:
        return reason(error)
    return None


def write_small(path, fill):
    """Write what fill(h5py.File) puts into a file, complete or not at all; HDF5 makes it in memory, see write_file. Local.

    Raises
    ------
    OutputError.
    """
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w", libver=("v108", "latest")) as file:  # before HDF5 1.8 a list had at most 64 kB
        fill(file)
    try:
        part = part_of(path)
        part.write_bytes(image.getbuffer())
    except OSError as error:
        _remove(part_name(path))
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    publish(part, path)


def _make_room(path, part, size, more):
    """Raise an OutputError or an OSError unless there is room for so many bytes, for `more` in attributes, and for what HDF5 adds."""
    around = _OVERHEAD + more
    system = os.statvfs(path.parent)
    free = system.f_bavail * system.f_frsize
    if system.f_blocks and free < size + around:
        raise OutputError(f"{path}: cannot be written (No space left on device: {free:,} bytes free, {size:,} needed)")
    with open(part, "wb") as file:
        file.write(bytes(around))
        file.flush()
        file.truncate(size + around)


def _remove(path):
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


def publish(part, path):
    """Give a complete file its name."""
    try:
        with open(part, "rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
