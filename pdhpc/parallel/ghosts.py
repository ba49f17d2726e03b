"""Ghost exchange: who sends which particles to whom, set up once, used every step."""
from copy import copy

import numpy as np

from pdhpc.jit import kernel


class GhostExchange:
    """Copy owners' values to their ghosts (`refresh`) and add ghosts' values to their owners (`accumulate`).

    Fields are indexed by slots; owned particles and ghosts may lie anywhere in them. Costs 4 bytes per sent or received particle plus the buffers of each
    bound field; one integer per rank is exchanged once, in set-up.
    """

    def __init__(self, comm, owned_ids, ghost_ids, ghost_owners, slots=None, ghost_slots=None):
        """Tell owners which of their particles are ghosts here. Collective.

        Parameters
        ----------
        owned_ids : (n_owned,) int64, ascending global ids. slots : (n_owned,) int32, where they lie in fields (default: first, in order).
        ghost_ids, ghost_owners : (n_ghost,) int64, sorted by (owner, id). ghost_slots : (n_ghost,) int32 (default: behind the owned, in order).
        """
        self.comm = comm
        self.n_owned, self.n_ghost = len(owned_ids), len(ghost_ids)
        slots = np.arange(self.n_owned, dtype=np.int32) if slots is None else slots
        ghost_slots = np.arange(self.n_owned, self.n_owned + self.n_ghost, dtype=np.int32) if ghost_slots is None else ghost_slots
        self._most = int(max(slots.max(initial=-1), ghost_slots.max(initial=-1)))
        counts = np.bincount(ghost_owners, minlength=comm.size).astype(np.int32) if self.n_ghost else np.zeros(comm.size, dtype=np.int32)
        wanted = np.empty(comm.size, dtype=np.int32)
        comm.Alltoall(counts, wanted)
        starts = np.concatenate(([0], np.cumsum(counts)))
        self.sources = [(r, np.ascontiguousarray(ghost_slots[starts[r] : starts[r + 1]], np.int32)) for r in np.flatnonzero(counts).tolist()]
        self.targets = self._answer_requests(np.ascontiguousarray(ghost_ids, dtype=np.int64), starts, owned_ids, slots, wanted)

    def _answer_requests(self, ghost_ids, starts, owned_ids, slots, wanted):
        """Return [(rank, slots of the particles it wants)]. Collective."""
        requests = [self.comm.Isend(ghost_ids[starts[rank] : starts[rank + 1]], dest=rank, tag=11) for rank, _ in self.sources]
        targets = []
        for rank in np.flatnonzero(wanted).tolist():
            ids = np.empty(wanted[rank], dtype=np.int64)
            self.comm.Recv(ids, source=rank, tag=11)
            targets.append((rank, slots[np.searchsorted(owned_ids, ids)].astype(np.int32)))
        for request in requests:
            request.Wait()
        return targets

    def restricted(self, keep):
        """Return the exchange of the particles that keep (n_slots,) bool marks; owners and holders of ghosts must agree on it. Local."""
        other = copy(self)
        other.sources = [(rank, slots[keep[slots]]) for rank, slots in self.sources if keep[slots].any()]
        other.targets = [(rank, slots[keep[slots]]) for rank, slots in self.targets if keep[slots].any()]
        return other

    @property
    def sent(self):
        """Number of particles sent per refresh by this rank."""
        return sum(len(slots) for _, slots in self.targets)

    def bind(self, field):
        """Return a `BoundField`: persistent messages for `field`, (n_slots,) or (n_slots, width) of any strides, kept alive by the caller. Local."""
        return BoundField(self, field)


class BoundField:
    """Persistent messages for one array; no allocation and no set-up in `refresh`.

    A message carries the columns of the field and nothing else: 8 bytes for each double of each ghost.
    """

    def __init__(self, exchange, field):
        if len(field) <= exchange._most:
            raise ValueError(f"a bound field has a row for each slot: {exchange._most + 1} are needed, {len(field)} given")
        self.field, self.exchange, comm = field, exchange, exchange.comm
        self._columns = field if field.ndim == 2 else field[:, None]
        width = self._columns.shape[1]
        self._owned = [(slots, np.empty((len(slots), width), field.dtype)) for _, slots in exchange.targets]
        self._ghosts = [(slots, np.empty((len(slots), width), field.dtype)) for _, slots in exchange.sources]
        targets, sources = [rank for rank, _ in exchange.targets], [rank for rank, _ in exchange.sources]
        self._refresh = [comm.Recv_init(buffer, source=rank, tag=12) for rank, (_, buffer) in zip(sources, self._ghosts)]
        self._refresh += [comm.Send_init(buffer, dest=rank, tag=12) for rank, (_, buffer) in zip(targets, self._owned)]
        self._accumulate = [comm.Recv_init(buffer, source=rank, tag=13) for rank, (_, buffer) in zip(targets, self._owned)]
        self._accumulate += [comm.Send_init(buffer, dest=rank, tag=13) for rank, (_, buffer) in zip(sources, self._ghosts)]

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per refresh."""
        return sum(buffer.nbytes for _, buffer in self._owned)

    def start_refresh(self):
        """Send owned values to the ranks that hold them as ghosts; ghosts must not be read until `finish_refresh`."""
        for slots, buffer in self._owned:
            _pack(self._columns, slots, buffer)
        _start(self._refresh)

    def finish_refresh(self):
        """Wait until the ghosts are up to date."""
        _wait(self._refresh)
        for slots, buffer in self._ghosts:
            _unpack(self._columns, slots, buffer)

    def refresh(self):
        """Copy owned values to ghosts (owner -> ghost). Collective over neighbours."""
        self.start_refresh()
        self.finish_refresh()

    def accumulate(self):
        """Add ghosts' values to their owners (ghost -> owner), in ascending rank of the ghosts' holders. Collective over neighbours."""
        for slots, buffer in self._ghosts:
            _pack(self._columns, slots, buffer)
        _start(self._accumulate)
        _wait(self._accumulate)
        for slots, buffer in self._owned:
            _add(self._columns, slots, buffer)

    def free(self):
        """Release the persistent messages. Local."""
        for request in self._refresh + self._accumulate:
            request.Free()
        self._refresh, self._accumulate = [], []


@kernel
def _pack(field, slots, buffer):
    for d in range(field.shape[1]):
        for n in range(len(slots)):
            buffer[n, d] = field[slots[n], d]


@kernel
def _unpack(field, slots, buffer):
    for d in range(field.shape[1]):
        for n in range(len(slots)):
            field[slots[n], d] = buffer[n, d]


@kernel
def _add(field, slots, buffer):
    for d in range(field.shape[1]):
        for n in range(len(slots)):
            field[slots[n], d] += buffer[n, d]


def compile_messages(*fields):
    """Compile what packs and unpacks rows of fields like these, (n, width) each, which gain nothing. Local."""
    none = np.empty(0, np.int32)
    for field in fields:
        buffer = np.empty((0, field.shape[1]), field.dtype)
        for loop in (_pack, _unpack, _add):
            loop(field, none, buffer)


def _start(requests):
    if requests:
        from mpi4py import MPI

        MPI.Prequest.Startall(requests)


def _wait(requests):
    if requests:
        from mpi4py import MPI

        MPI.Request.Waitall(requests)
