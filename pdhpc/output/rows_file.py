"""HDF5 files that ranks write together, each its own rows of every dataset, complete or not at all."""
import os
from typing import NamedTuple

import numpy as np

from pdhpc.output.record import OutputError, part_of
from pdhpc.parallel.comm import abort, on_root


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

    Datasets are contiguous and uncompressed; rows lie in rank order.

    Parameters
    ----------
    data : {name: (n, ...) array}, this rank's rows, of the same kinds on every rank. attributes : {name: value} of the file, those of rank 0 count.

    Raises
    ------
    OutputError: on every rank, with the reason. Where parallel HDF5 fails on some ranks alone, whom others wait for inside it, the job is aborted with the sentence.
    """
    part = on_root(comm, _make_room, path, comm.allreduce(sum(values.nbytes for values in data.values())))
    write = _write_together if comm.size > 1 and not takes_turns(comm) else _write_in_turn
    rows = dict(zip(data, Rows.of(comm, [len(values) for values in data.values()])))
    error = write(comm, part, data, rows, attributes)
    errors = [each for each in comm.allgather(error) if each is not None]
    if errors:
        on_root(comm, _remove, part)
        raise OutputError(f"{path}: cannot be written ({errors[0]})")
    on_root(comm, publish, part, path)


def _write_together(comm, part, data, rows, attributes):
    """Write with parallel HDF5; return what went wrong, or None."""
    import h5py

    on_root(comm, _touch, part)
    try:
        with h5py.File(part, "w", driver="mpio", comm=comm) as file:
            _create(file, data, rows, comm.bcast(attributes))
            for key, values in data.items():
                _write_rows(file[key], rows[key].first, values)
    except (OSError, RuntimeError, ValueError) as error:
        abort(comm, f"{part}: cannot be written ({reason(error)})")
    return None


def _write_in_turn(comm, part, data, rows, attributes):
    """Write one rank after the other; return what went wrong, or None."""
    import h5py

    error = None
    for rank in range(comm.size):
        if rank == comm.rank:
            try:
                with h5py.File(part, "w" if rank == 0 else "r+") as file:
                    if rank == 0:
                        _create(file, data, rows, attributes)
                    for key, values in data.items():
                        file[key][rows[key].first : rows[key].first + rows[key].count] = values
            except (OSError, RuntimeError, KeyError) as caught:
                error = reason(caught)
        comm.Barrier()
    return error


def _create(file, data, rows, attributes):
    for key, values in data.items():
        file.create_dataset(key, shape=(rows[key].total,) + values.shape[1:], dtype=values.dtype)
    for key, value in attributes.items():
        file.attrs[key] = value


def _write_rows(dataset, first, values):
    """Write the rows of this rank, collectively with all others: a rank without rows selects nothing, but must take part, or the others wait for ever."""
    from h5py import h5fd, h5p, h5s

    memory = h5s.create_simple((max(1, len(values)),) + values.shape[1:])
    target = dataset.id.get_space()
    if values.size:
        target.select_hyperslab((first,) + (0,) * (values.ndim - 1), values.shape)
    else:
        memory.select_none()
        target.select_none()
        values = np.zeros((1,) + values.shape[1:], values.dtype)
    transfer = h5p.create(h5p.DATASET_XFER)
    transfer.set_dxpl_mpio(h5fd.MPIO_COLLECTIVE)
    dataset.id.write(memory, target, np.ascontiguousarray(values), dxpl=transfer)


def takes_turns(comm):
    """Whether ranks write one after the other, for an h5py that is built without MPI. Local."""
    import h5py

    return comm.size > 1 and not h5py.get_config().mpi


def reason(error):
    """Return the system's word on an error, or the first line of the library's."""
    return getattr(error, "strerror", None) or str(error).splitlines()[0].split(": time =")[0]


def _make_room(path, size):
    """Return the name that a file has until it is complete; an OutputError unless the file system has room for so many bytes and what HDF5 adds."""
    try:
        system, part = os.statvfs(path.parent), part_of(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    free = system.f_bavail * system.f_frsize
    if system.f_blocks and free < size + _OVERHEAD:
        raise OutputError(f"{path}: cannot be written (No space left on device: {free:,} bytes free, {size:,} needed)")
    return part


def _remove(path):
    path.unlink(missing_ok=True)


def _touch(path):
    """Try to create a file with plain system calls first: their errors say more than those of parallel HDF5."""
    try:
        with open(path, "wb"):
            pass
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def publish(part, path):
    """Give a complete file its name."""
    try:
        with open(part, "rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
