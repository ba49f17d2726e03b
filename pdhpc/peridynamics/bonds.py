"""The bonds of one rank's owned particles and everything computed from them."""
from dataclasses import dataclass

import numpy as np

from pdhpc.kernels import bond_states
from pdhpc.kernels.neighbours import BondArrays, find_bonds, mark_used, renumber


class SamePlace(ValueError):
    """Two particles lie at the same place; ids : of both."""

    def __init__(self, *ids):
        super().__init__("two particles lie at the same place: bodies overlap")
        self.ids = ids

    def __reduce__(self):
        return SamePlace, self.ids


@dataclass
class Bonds:
    """Families of the owned particles.

    Attributes
    ----------
    arrays : BondArrays or LatticeArrays, full list: bonds across a rank border are held by both owners.
    slots : (n_owned,) int32, of the owned particles.
    family_size : (n_owned,) int, neighbours within the family radius before any crack.
    initial_size : (n_owned,) int, those left after the pre-cracks.
    """

    arrays: BondArrays
    slots: np.ndarray
    family_size: np.ndarray
    initial_size: np.ndarray

    @property
    def n_directed(self):
        """Bonds of the owned particles, each end counted: twice the number of bonds when summed over ranks."""
        return int(self.family_size.sum(dtype=np.int64))

    def count(self, counts):
        """Store the number of intact bonds of each owned particle in counts (n_owned,)."""
        bond_states.count_intact(self.arrays, self.slots, counts)

    def alive(self):
        """Return (n_owned,) int, intact bonds of each particle."""
        counts = np.empty_like(self.family_size)
        self.count(counts)
        return counts

    def states(self):
        """Return (n_owned, width) uint8 or uint64: the states of each particle's bonds, a bit each, in ascending id of the neighbours. A copy.

        width : as wide as the largest family here needs; rows of other ranks may be narrower.
        """
        alive = self.arrays.alive
        if alive.ndim == 2:
            return alive.T[self.slots]
        first, count = self._bytes()
        result = np.zeros((len(first), count.max(initial=0)), np.uint8)
        bond_states.spread_bytes(alive, first, count, result)
        return result

    def set_states(self, rows):
        """Take states as `states` returned them, by rows that may be wider."""
        alive = self.arrays.alive
        if alive.ndim == 2:
            alive.T[self.slots] = rows[:, : len(alive)]
            return
        bond_states.collect_bytes(np.ascontiguousarray(rows), *self._bytes(), alive)

    def _bytes(self):
        """Return (first, number) of the bytes that hold the states of each particle's bonds, (n_owned,) int64."""
        start = self.arrays.row_start.astype(np.int64) >> 3
        return start[:-1], np.diff(start)

    def damage(self):
        """Return (n_owned,) damage grown since the start: 1 - intact / initially intact; 0 for particles that had no bond."""
        return 1.0 - self.alive() / np.maximum(self.initial_size, 1) - (self.initial_size == 0)

    def precrack(self):
        """Return (n_owned,) share of each family cut by pre-cracks."""
        return 1.0 - self.initial_size / np.maximum(self.family_size, 1) - (self.family_size == 0)


def find_families(reference, ids, n_owned, radius, group=None):
    """Return (Bonds of the owned particles, keep): keep marks the points that are owned or somebody's neighbour. Local.

    The neighbours in the bonds are numbered after dropping the points that are not kept. radius, group : as of kernels.neighbours.count_neighbours.

    Raises
    ------
    SamePlace: two particles at the same place.
    """
    arrays, sizes = find_bonds(reference, ids, n_owned, radius, group)
    if not np.all(np.isfinite(arrays.inv_length)):
        slot = int(np.argmin(np.isfinite(arrays.inv_length)))
        row = int(np.searchsorted(arrays.row_start, slot, side="right")) - 1
        raise SamePlace(int(ids[row]), int(ids[arrays.neighbour[slot]]))
    keep = mark_used(arrays.neighbour, len(ids))
    keep[:n_owned] = True
    renumber(arrays.neighbour, (np.cumsum(keep) - 1).astype(np.int32))
    return Bonds(arrays, np.arange(n_owned, dtype=np.int32), sizes, sizes), keep


def cut_by_cracks(bonds, points, facets):
    """Cut the bonds that cross the facets of pre-cracks (geometry/cracks.py); return how many directed bonds that took. Local."""
    cut = sum(bond_states.cut_bonds(bonds.arrays, points, bonds.slots, *facet) for facet in facets)
    bonds.initial_size = bonds.alive() if cut else bonds.initial_size
    return cut
