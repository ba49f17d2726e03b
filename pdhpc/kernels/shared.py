"""Weighted bonds of marked particles: the seam for methods that share a body between several problems.

An overlap shares each bond between two regions, a ramp fades bonds out: both give the bonds of some particles weights between 0 and 1. The weights lie in a
small list of their own, one row for each marked particle; the lists and kernels of all other particles know nothing of them. A rank leaves marked particles
out of the rows of its main sweeps and sweeps them with `SharedBonds` in the place of its bonds.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements, kernel
from pdhpc.kernels import family
from pdhpc.kernels.cloud import BondArrays
from pdhpc.kernels.lattice import LatticeArrays
from pdhpc.kernels.reference import dilatation_of, energy_of, force_on, frequency_of


class CloudShares(NamedTuple):
    """Bonds of a cloud with weights: bonds BondArrays; marked (n_slots,) int32: row of a marked particle, else -1; row_start (n_marked + 1,); weight (n,)."""

    bonds: BondArrays
    marked: np.ndarray
    row_start: np.ndarray
    weight: np.ndarray


class LatticeShares(NamedTuple):
    """Bonds of a lattice with weights, as CloudShares."""

    bonds: LatticeArrays
    marked: np.ndarray
    row_start: np.ndarray
    weight: np.ndarray


def share_bonds(bonds, n_slots, marked):
    """Return the bonds with a weight of 1 for every bond of the particles in `marked` (n,) slots, to be set through `weights_of`. Local.

    Costs 8 bytes for each bond of a marked particle and 4 for every slot.
    """
    row = np.full(n_slots, -1, np.int32)
    row[marked] = np.arange(len(marked), dtype=np.int32)
    if isinstance(bonds, LatticeArrays):
        start = np.arange(len(marked) + 1, dtype=np.int64) * len(bonds.offset)
        return LatticeShares(bonds, row, start, np.ones(int(start[-1])))
    start = np.concatenate(([0], np.cumsum(np.diff(bonds.row_start)[marked])))
    return CloudShares(bonds, row, start, np.ones(int(start[-1])))


@kernel
def weights_of(shares, points, ramp, marked):
    """Set the weight of each bond of the slots in `marked` to the mean (ramp_i + ramp_j)/2 of its ends; ramp (n_slots,), 0 to 1."""
    for n in range(len(marked)):
        i = marked[n]
        start = shares.row_start[shares.marked[i]]
        for k in range(family.first_bond(shares, i), family.end_of_bonds(shares, i)):
            shares.weight[start + k - family.first_bond(shares, i)] = 0.5 * (ramp[i] + ramp[family.neighbour(shares, i, k)])


def _delegate(record):
    @implements(family.first_bond, record)
    def _first_bond(bonds, i):
        return family.first_bond(bonds.bonds, i)

    @implements(family.end_of_bonds, record)
    def _end_of_bonds(bonds, i):
        return family.end_of_bonds(bonds.bonds, i)

    @implements(family.neighbour, record)
    def _neighbour(bonds, i, k):
        return family.neighbour(bonds.bonds, i, k)

    @implements(family.is_alive, record)
    def _is_alive(bonds, i, k):
        return family.is_alive(bonds.bonds, i, k)

    @implements(family.break_bond, record)
    def _break_bond(bonds, i, k):
        family.break_bond(bonds.bonds, i, k)

    @implements(family.count_alive, record)
    def _count_alive(bonds, i):
        return family.count_alive(bonds.bonds, i)

    @implements(family.inverse_length, record)
    def _inverse_length(bonds, i, k):
        return family.inverse_length(bonds.bonds, i, k)

    @implements(family.reference_vector, record)
    def _reference_vector(bonds, points, i, j, k, third):
        return family.reference_vector(bonds.bonds, points, i, j, k, third)

    @implements(family.place, record)
    def _place(bonds, points, i):
        return family.place(bonds.bonds, points, i)

    @implements(family.share, record)
    def _share(bonds, i, k):
        return bonds.weight[bonds.row_start[bonds.marked[i]] + k - family.first_bond(bonds.bonds, i)]

    @implements(family.row_width, record)
    def _row_width(bonds):
        return 1

    @implements(family.force_row, record)
    def _force_row(bonds, i, points, law, state, linear, third, force_density):
        return force_on(bonds, i, points, law, state, linear, third, force_density)

    @implements(family.dilatation_row, record)
    def _dilatation_row(bonds, i, points, law, state, linear, third):
        return dilatation_of(bonds, i, points, law, state, linear, third)

    @implements(family.energy_row, record)
    def _energy_row(bonds, i, points, law, state, linear, third, energy):
        energy_of(bonds, i, points, law, state, linear, third, energy)

    @implements(family.frequency_row, record)
    def _frequency_row(bonds, i, points, law, state, third):
        return frequency_of(bonds, i, points, law, state, third)


for _record in (CloudShares, LatticeShares):
    _delegate(_record)
