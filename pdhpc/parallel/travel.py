"""Rows of arrays that travel between ranks in set-up: from the rank that reads them to all, and to the ranks that want them."""
import numpy as np


def share_pieces(comm, pieces):
    """Yield (first, arrays) of each piece that rank 0 makes: this rank's equal share of its rows, and the number of the first of them. Collective.

    Rank 0 holds one piece at a time beside its shares; what goes wrong there is raised on every rank.

    Parameters
    ----------
    pieces : iterator of tuples of arrays with the same number of rows; read on rank 0 only.
    """
    done = 0
    while True:
        arrays = failure = None
        if comm.rank == 0:
            try:
                arrays = next(pieces, None)
            except Exception as caught:
                failure = caught
        kinds = None if arrays is None else [(len(each), each.shape[1:], each.dtype.str) for each in arrays]
        kinds, failure = comm.bcast((kinds, failure))
        if failure is not None:
            raise failure
        if kinds is None:
            return
        count = kinds[0][0]
        edges = count * np.arange(comm.size + 1, dtype=np.int64) // comm.size
        yield done + int(edges[comm.rank]), tuple(_scatter(comm, None if arrays is None else arrays[k], kind, edges) for k, kind in enumerate(kinds))
        done += count


def _scatter(comm, rows, kind, edges):
    """Return the rows edges[rank] ... edges[rank + 1] - 1 that rank 0 holds. Collective."""
    _, tail, dtype = kind
    mine = np.empty((int(edges[comm.rank + 1] - edges[comm.rank]), *tail), dtype)
    row = _row_type(mine)
    sent = None if rows is None else [np.ascontiguousarray(rows), np.diff(edges).tolist(), edges[:-1].tolist(), row]
    comm.Scatterv(sent, [mine, len(mine), row])
    row.Free()
    return mine


def send_rows(comm, rank, arrays):
    """Return arrays of the rows that all ranks send here, by sender, in the sender's order. Collective.

    Parameters
    ----------
    rank : (n,) int, where each row goes. arrays : of n rows each, of the same kinds on every rank.
    """
    order = np.argsort(rank, kind="stable")
    counts = np.bincount(rank, minlength=comm.size).astype(np.int32)
    arriving = np.empty(comm.size, np.int32)
    comm.Alltoall(counts, arriving)
    starts, ends = (np.concatenate(([0], np.cumsum(each)[:-1])).astype(np.int32) for each in (counts, arriving))
    received = []
    for each in arrays:
        sent = np.ascontiguousarray(each[order])
        here = np.empty((int(arriving.sum()), *each.shape[1:]), each.dtype)
        row = _row_type(here)
        comm.Alltoallv([sent, (counts, starts), row], [here, (arriving, ends), row])
        row.Free()
        received.append(here)
    return received


def _row_type(array):
    """Return the MPI type of one row of an array, to be freed."""
    from mpi4py import MPI

    return MPI.BYTE.Create_contiguous(int(array.dtype.itemsize * np.prod(array.shape[1:], dtype=np.int64))).Commit()


def fetch_rows(comm, ids, arrays, wanted):
    """Return arrays of the rows that belong to the ids `wanted`, wherever they are. Collective.

    Every id has a home, rank id mod size, that rows pass through: a rank holds its share of them three times while they travel.

    Parameters
    ----------
    ids : (n,) int64, of the rows here, each id once over all ranks. arrays : of n rows each, of the same kinds on every rank. wanted : (m,) int64.

    Raises
    ------
    KeyError: on every rank, when an id is nowhere; its number.
    """
    held, *rows = send_rows(comm, ids % comm.size, [ids, *arrays])
    order = np.argsort(held, kind="stable")
    held = held[order]
    asked, origin = send_rows(comm, wanted % comm.size, [wanted, np.full(len(wanted), comm.rank, np.int64)])
    place = np.minimum(np.searchsorted(held, asked), max(len(held) - 1, 0))
    lost = asked[held[place] != asked] if len(held) else asked
    missing = [each for each in comm.allgather(int(lost[0]) if len(lost) else None) if each is not None]
    if missing:
        raise KeyError(missing[0])
    answers = send_rows(comm, origin, [asked, *(each[order[place]] for each in rows)])
    back = np.argsort(answers[0], kind="stable")[np.argsort(np.argsort(wanted, kind="stable"), kind="stable")]
    return [each[back] for each in answers[1:]]
