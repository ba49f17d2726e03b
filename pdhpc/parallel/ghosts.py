"""Ghost exchange: who sends which particles to whom, set up once, used every step."""
import numpy as np


class GhostExchange:
    """Copy owners' values to their ghosts (`refresh`) and add ghosts' values to their owners (`accumulate`).

    Local numbering: owned particles first, in ascending id; then ghosts, grouped by owner in ascending rank and ascending id within a group, so that
    what a neighbour sends lands in one contiguous block without unpacking. Costs 4 bytes per sent particle plus the buffers of each bound field;
    one integer per rank is exchanged once, in set-up.
    """

    def __init__(self, comm, owned_ids, ghost_ids, ghost_owners):
        """Tell owners which of their particles are ghosts here. Collective.

        Parameters
        ----------
        owned_ids : (n_owned,) int64, ascending global ids.
        ghost_ids, ghost_owners : (n_ghost,) int64, sorted by (owner, id).
        """
        self.comm = comm
        self.n_owned, self.n_ghost = len(owned_ids), len(ghost_ids)
        counts = np.bincount(ghost_owners, minlength=comm.size).astype(np.int32) if self.n_ghost else np.zeros(comm.size, dtype=np.int32)
        wanted = np.empty(comm.size, dtype=np.int32)
        comm.Alltoall(counts, wanted)
        starts = np.concatenate(([0], np.cumsum(counts)))
        self.sources = [(r, int(starts[r]), int(starts[r + 1])) for r in np.flatnonzero(counts).tolist()]
        self.targets = self._answer_requests(np.ascontiguousarray(ghost_ids, dtype=np.int64), owned_ids, wanted)

    def _answer_requests(self, ghost_ids, owned_ids, wanted):
        """Return [(rank, local indices of the particles it wants)]. Collective."""
        requests = [self.comm.Isend(ghost_ids[first:last], dest=rank, tag=11) for rank, first, last in self.sources]
        targets = []
        for rank in np.flatnonzero(wanted).tolist():
            ids = np.empty(wanted[rank], dtype=np.int64)
            self.comm.Recv(ids, source=rank, tag=11)
            targets.append((rank, np.searchsorted(owned_ids, ids).astype(np.int32)))
        for request in requests:
            request.Wait()
        return targets

    @property
    def sent(self):
        """Number of particles sent per refresh by this rank."""
        return sum(len(indices) for _, indices in self.targets)

    def bind(self, field):
        """Return a `BoundField`: persistent messages for `field`, (n_owned + n_ghost, width), C-contiguous, kept alive by the caller. Local."""
        return BoundField(self, field)


class BoundField:
    """Persistent messages for one array; no allocation and no set-up in `refresh`."""

    def __init__(self, exchange, field):
        if not field.flags.c_contiguous or len(field) != exchange.n_owned + exchange.n_ghost:
            raise ValueError("a bound field is C-contiguous and holds owned and ghost particles")
        self.field, self.exchange = field, exchange
        comm, first_ghost = exchange.comm, exchange.n_owned
        self._packed = [(indices, np.empty((len(indices),) + field.shape[1:], field.dtype)) for _, indices in exchange.targets]
        self._ghosts = [field[first_ghost + first : first_ghost + last] for _, first, last in exchange.sources]
        self._refresh = [comm.Recv_init(ghosts, source=rank, tag=12) for ghosts, (rank, _, _) in zip(self._ghosts, exchange.sources)]
        self._refresh += [comm.Send_init(packed, dest=rank, tag=12) for (_, packed), (rank, _) in zip(self._packed, exchange.targets)]
        self._accumulate = [comm.Recv_init(packed, source=rank, tag=13) for (_, packed), (rank, _) in zip(self._packed, exchange.targets)]
        self._accumulate += [comm.Send_init(ghosts, dest=rank, tag=13) for ghosts, (rank, _, _) in zip(self._ghosts, exchange.sources)]

    def start_refresh(self):
        """Send owned values to the ranks that hold them as ghosts; ghosts must not be read until `finish_refresh`."""
        for indices, packed in self._packed:
            np.take(self.field, indices, axis=0, out=packed, mode="clip")
        _start(self._refresh)

    def finish_refresh(self):
        """Wait until the ghosts are up to date."""
        _wait(self._refresh)

    def refresh(self):
        """Copy owned values to ghosts (owner -> ghost). Collective over neighbours."""
        self.start_refresh()
        self.finish_refresh()

    def accumulate(self):
        """Add ghosts' values to their owners (ghost -> owner), in ascending rank of the ghosts' holders. Collective over neighbours."""
        _start(self._accumulate)
        _wait(self._accumulate)
        for indices, packed in self._packed:
            self.field[indices] += packed  # indices of one target are distinct

    def free(self):
        """Release the persistent messages. Local."""
        for request in self._refresh + self._accumulate:
            request.Free()
        self._refresh, self._accumulate = [], []


def _start(requests):
    if requests:
        from mpi4py import MPI

        MPI.Prequest.Startall(requests)


def _wait(requests):
    if requests:
        from mpi4py import MPI

        MPI.Request.Waitall(requests)
