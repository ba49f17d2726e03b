"""The bonds of one rank's owned particles and everything computed from them."""
from dataclasses import dataclass

import numpy as np

from pdhpc.geometry.cracks import cut_bonds
from pdhpc.kernels.bond_states import count_alive
from pdhpc.kernels.neighbours import BondArrays, find_bonds, mark_used, renumber


@dataclass
class Bonds:
    """Families of the owned particles.

    Attributes
    ----------
    arrays : BondArrays, full list: bonds across a rank border are held by both owners.
    family_size : (n_owned,) int32, neighbours within the family radius before any crack.
    initial_size : (n_owned,) int32, those left after the pre-cracks.
    """

    arrays: BondArrays
    family_size: np.ndarray
    initial_size: np.ndarray

    @property
    def n_directed(self):
        """Bonds of the owned particles, each end counted: twice the number of bonds when summed over ranks."""
        return int(self.family_size.sum(dtype=np.int64))

    def alive(self):
        """Return (n_owned,) int32, intact bonds of each particle."""
        counts = np.empty(len(self.family_size), np.int32)
        count_alive(self.arrays, counts)
        return counts

    def damage(self):
        """Return (n_owned,) damage grown since the start: 1 - intact / initially intact; 0 for particles that had no bond."""
        return 1.0 - self.alive() / np.maximum(self.initial_size, 1) - (self.initial_size == 0)

    def precrack(self):
        """Return (n_owned,) share of each family cut by pre-cracks."""
        return 1.0 - self.initial_size / np.maximum(self.family_size, 1) - (self.family_size == 0)


def find_families(reference, ids, n_owned, radius):
    """Return (Bonds of the owned particles, keep): keep marks the points that are owned or somebody's neighbour. Local.

    The neighbours in the bonds are numbered after dropping the points that are not kept.

    Raises
    ------
    ValueError: two particles at the same place.
    """
    arrays, sizes = find_bonds(reference, ids, n_owned, radius)
    if not np.all(np.isfinite(arrays.inv_length)):
        raise ValueError("two particles lie at the same place: bodies overlap")
    keep = mark_used(arrays.neighbour, len(ids))
    keep[:n_owned] = True
    renumber(arrays.neighbour, (np.cumsum(keep) - 1).astype(np.int32))
    return Bonds(arrays, sizes, sizes), keep


def cut_by_cracks(bonds, particles, facets):
    """Cut the bonds that cross the facets of pre-cracks; return how many directed bonds that took. Local."""
    cut = cut_bonds(bonds.arrays, particles.reference, particles.n_owned, facets)
    bonds.initial_size = bonds.alive() if cut else bonds.initial_size
    return cut
