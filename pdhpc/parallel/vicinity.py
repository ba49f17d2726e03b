"""Who is near whom as bodies move: ranks whose particles may touch, found from boxes, and what they tell each other."""
import numpy as np

from pdhpc.parallel.ghosts import GhostExchange

_TAG = 14


class Vicinity:
    """The ranks that share a body, as those see them who look for what comes near their particles."""

    def __init__(self, comm):
        self.comm = comm

    def agree(self, values):
        """Return the largest of the ranks' values (n,), entry by entry; what all ranks decide from them they decide alike. Collective."""
        from mpi4py import MPI

        self.comm.Allreduce(MPI.IN_PLACE, values, MPI.MAX)
        return values

    def gather_near(self, rows, dim, reach):
        """Return (rows, owners) of the other ranks' particles in the box of this rank's ones, grown by `reach`, by owner and then in the owner's order. Collective.

        Boxes go to every rank (16 dim bytes each); rows only from rank to rank, where grown boxes meet.

        Parameters
        ----------
        rows : (n, width) float, of which the first dim columns are positions, m. reach : m.
        """
        place = rows[:, :dim]
        box = np.concatenate([place.min(axis=0), place.max(axis=0)]) if len(rows) else np.concatenate([np.full(dim, np.inf), np.full(dim, -np.inf)])
        boxes = np.empty((self.comm.size, 2 * dim))
        self.comm.Allgather(box, boxes)
        lower, upper = boxes[:, :dim] - reach, boxes[:, dim:] + reach
        met = ((lower[self.comm.rank] <= boxes[:, dim:]) & (boxes[:, :dim] <= upper[self.comm.rank])).all(axis=1)
        met &= ((boxes[self.comm.rank, :dim] <= upper) & (lower <= boxes[self.comm.rank, dim:])).all(axis=1)  # both sides find the same pairs
        met[self.comm.rank] = False
        ranks = np.flatnonzero(met).tolist()
        outgoing = [np.ascontiguousarray(rows[((place >= lower[rank]) & (place <= upper[rank])).all(axis=1)]) for rank in ranks]
        requests = [self.comm.Isend(each, dest=rank, tag=_TAG) for rank, each in zip(ranks, outgoing)]
        received = [self._receive(rank, rows.shape[1]) for rank in ranks]
        for request in requests:
            request.Wait()
        owners = np.repeat(np.array(ranks, np.int64), [len(each) for each in received])
        return np.concatenate(received) if received else np.empty((0, rows.shape[1])), owners

    def _receive(self, rank, width):
        """Return the rows that a rank sent."""
        from mpi4py import MPI

        status = MPI.Status()
        self.comm.Probe(source=rank, tag=_TAG, status=status)
        rows = np.empty((status.Get_count(MPI.DOUBLE) // width, width))
        self.comm.Recv(rows, source=rank, tag=_TAG)
        return rows

    def exchange(self, owned_ids, ghost_ids, owners):
        """Return the GhostExchange of owned particles, in the first rows of fields, and ghosts, behind them, by (owner, id). Collective."""
        return GhostExchange(self.comm, owned_ids, ghost_ids, owners)
