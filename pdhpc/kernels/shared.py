"""Shared bonds of marked particles: the seam for methods that share a body between several problems.

An overlap shares each bond and each particle between two regions. Both give the bonds of some particles weights between 0 and 1 and hold but a share of the
masses and energies of these particles. All of it lies in a small list of its own, one row for each marked row (a particle of a cloud, a block of eight of a
lattice); the lists and kernels of all other particles know nothing of it. A rank leaves the marked rows out of its main sweeps and sweeps them with
`CloudShares` or `LatticeShares` in the place of its bonds: f_i = 1/mass share sum_j weight pull_ij V_j d_ij is then what f_i / rho_i accelerates the share by.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements, sweep
from pdhpc.kernels import family
from pdhpc.kernels.cloud import BondArrays, dilatation_of_row, force_of_row
from pdhpc.kernels.family import MIXED, VARIED
from pdhpc.kernels.lattice import LatticeArrays, dilatation_of_eight, energy_of_eight, force_of_eight, frequency_of_eight
from pdhpc.kernels.reference import dilatation_of, energy_of, force_on, frequency_of
from pdhpc.kernels.simd import LANES
from pdhpc.materials.law import bond_weight, far_end, moduli, near_end, weighting_between


class CloudShares(NamedTuple):
    """Shared bonds of a cloud.

    bonds BondArrays; row (n_slots,) int32: of a marked particle, else -1; row_start (n_marked + 1,) int64: first weight of each; weight (n,), of each bond slot;
    over_mass, over_energy (n_marked,): one over the share of the particle's mass and of its energy that is here (0 where no energy is).
    """

    bonds: BondArrays
    row: np.ndarray
    row_start: np.ndarray
    weight: np.ndarray
    over_mass: np.ndarray
    over_energy: np.ndarray


class LatticeShares(NamedTuple):
    """Shared bonds of a lattice, as CloudShares, of eight particles together.

    row (n_slots / 8,) int32: of a marked block; weight (n_marked, n_stencil, 8); over_mass, over_energy (n_marked, 8).
    """

    bonds: LatticeArrays
    row: np.ndarray
    weight: np.ndarray
    over_mass: np.ndarray
    over_energy: np.ndarray


def row_width_of(bonds):
    """Return the number of particles of a row of a BondArrays or LatticeArrays. Local."""
    return LANES if isinstance(bonds, LatticeArrays) else 1


def share_bonds(bonds, n_slots, rows):
    """Return the shares of the bonds of some `rows` (n,) (particles of a cloud, blocks of a lattice), all of them 1, to be set. Local.

    Costs 8 bytes for each bond of a marked row and 16 for each of its particles, and 4 for every slot (lattice: for every block of eight).
    """
    if isinstance(bonds, LatticeArrays):
        row = np.full(n_slots // LANES, -1, np.int32)
        row[np.asarray(rows) // LANES] = np.arange(len(rows), dtype=np.int32)
        return LatticeShares(bonds, row, np.ones((len(rows), len(bonds.offset), LANES)), np.ones((len(rows), LANES)), np.ones((len(rows), LANES)))
    row = np.full(n_slots, -1, np.int32)
    row[rows] = np.arange(len(rows), dtype=np.int32)
    start = np.concatenate(([0], np.cumsum(np.diff(bonds.row_start)[rows])))
    return CloudShares(bonds, row, start, np.ones(int(start[-1])), np.ones(len(rows)), np.ones(len(rows)))


def set_weight(bonds, i, k, value):
    """Set the weight of a bond of a marked particle."""


def set_over_mass(bonds, i, value):
    """Set one over the mass share of a marked particle."""


def set_over_energy(bonds, i, value):
    """Set one over the energy share of a marked particle."""


@sweep
def share_by_ramp(shares, ramp, slots):
    """Give each bond of the marked particles in `slots` its weight: 1 where an end is whole (ramp = 1), else the mean (ramp_i + ramp_j)/2.

    ramp (n_slots,), 0 to 1. Bonds to ends of ramp 0 are not in this problem, so that the weights of the two regions of an overlap, of ramps r and 1 - r, add
    up to 1 for every bond.
    """
    for n in range(len(slots)):
        i = slots[n]
        for k in range(family.first_bond(shares, i), family.end_of_bonds(shares, i)):
            if family.is_alive(shares, i, k):
                j = family.neighbour(shares, i, k)
                whole = ramp[i] == 1.0 or ramp[j] == 1.0
                set_weight(shares, i, k, 1.0 if whole else 0.5 * (ramp[i] + ramp[j]))


@sweep
def stiffnesses(bonds, points, law, state, slots, result):
    """Store k_i = sum_j share C weight V_j, N/m^5, the trace of the stiffness of a particle's own alive bonds, of `slots` (n,) in result (n,)."""
    for n in range(len(slots)):
        i, total = slots[n], 0.0
        for k in range(family.first_bond(bonds, i), family.end_of_bonds(bonds, i)):
            if family.is_alive(bonds, i, k):
                j = family.neighbour(bonds, i, k)
                c, _ = moduli(law, near_end(law, points, state, i, j), far_end(law, state, j))
                weighting = weighting_between(law.weighting, points.block[i], points.block[j])
                total += c * bond_weight(law, weighting, family.inverse_length(bonds, i, k)) * family.share(bonds, i, k) * points.volume[j]
        result[n] = total


@sweep
def set_over_masses(shares, slots, over_mass):
    """Set one over the mass share of the marked particles in `slots` (n,) to over_mass (n,)."""
    for n in range(len(slots)):
        set_over_mass(shares, slots[n], over_mass[n])


@sweep
def set_over_energies(shares, slots, over_energy):
    """Set one over the energy share of the marked particles in `slots` (n,) to over_energy (n,)."""
    for n in range(len(slots)):
        set_over_energy(shares, slots[n], over_energy[n])


def _delegate(record):
    """Let shares answer as their bonds do."""

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

    @implements(family.row_width, record)
    def _row_width(bonds):
        return family.row_width(bonds.bonds)


for _record in (CloudShares, LatticeShares):
    _delegate(_record)


@implements(family.share, CloudShares)
def _share_of_cloud(bonds, i, k):
    return bonds.weight[bonds.row_start[bonds.row[i]] + k - bonds.bonds.row_start[i]]


@implements(family.share, LatticeShares)
def _share_of_lattice(bonds, i, k):
    return bonds.weight[bonds.row[i >> 3], k, i & 7]


@implements(set_weight, CloudShares)
def _set_weight_of_cloud(bonds, i, k, value):
    bonds.weight[bonds.row_start[bonds.row[i]] + k - bonds.bonds.row_start[i]] = value


@implements(set_weight, LatticeShares)
def _set_weight_of_lattice(bonds, i, k, value):
    bonds.weight[bonds.row[i >> 3], k, i & 7] = value


@implements(family.over_mass, CloudShares)
def _over_mass_of_cloud(bonds, i):
    return bonds.over_mass[bonds.row[i]]


@implements(family.over_mass, LatticeShares)
def _over_mass_of_lattice(bonds, i):
    return bonds.over_mass[bonds.row[i >> 3], i & 7]


@implements(set_over_mass, CloudShares)
def _set_over_mass_of_cloud(bonds, i, value):
    bonds.over_mass[bonds.row[i]] = value


@implements(set_over_mass, LatticeShares)
def _set_over_mass_of_lattice(bonds, i, value):
    bonds.over_mass[bonds.row[i >> 3], i & 7] = value


@implements(family.over_energy, CloudShares)
def _over_energy_of_cloud(bonds, i):
    return bonds.over_energy[bonds.row[i]]


@implements(family.over_energy, LatticeShares)
def _over_energy_of_lattice(bonds, i):
    return bonds.over_energy[bonds.row[i >> 3], i & 7]


@implements(set_over_energy, CloudShares)
def _set_over_energy_of_cloud(bonds, i, value):
    bonds.over_energy[bonds.row[i]] = value


@implements(set_over_energy, LatticeShares)
def _set_over_energy_of_lattice(bonds, i, value):
    bonds.over_energy[bonds.row[i >> 3], i & 7] = value


@implements(family.force_row, CloudShares)
def _force_row_of_cloud(bonds, i, points, law, state, linear, third, force_density):
    if points.row_block[i] == MIXED:
        return force_on(bonds, i, points, law, state, linear, third, force_density)
    if points.row_block[i] == VARIED:
        return force_of_row(bonds.bonds, bonds, points.volume, i, points, law, state, linear, third, force_density)
    return force_of_row(bonds.bonds, bonds, None, i, points, law, state, linear, third, force_density)


@implements(family.force_row, LatticeShares)
def _force_row_of_lattice(bonds, i, points, law, state, linear, third, force_density):
    return force_of_eight(bonds.bonds, bonds, i, points, law, state, linear, third, force_density)


@implements(family.dilatation_row, CloudShares)
def _dilatation_row_of_cloud(bonds, i, points, law, state, linear, third):
    if points.row_block[i] == MIXED:
        return dilatation_of(bonds, i, points, law, state, linear, third)
    if points.row_block[i] == VARIED:
        return dilatation_of_row(bonds.bonds, bonds, points.volume, i, points, law, state, linear, third)
    return dilatation_of_row(bonds.bonds, bonds, None, i, points, law, state, linear, third)


@implements(family.dilatation_row, LatticeShares)
def _dilatation_row_of_lattice(bonds, i, points, law, state, linear, third):
    return dilatation_of_eight(bonds.bonds, bonds, i, points, law, state, linear, third)


@implements(family.energy_row, CloudShares)
def _energy_row_of_cloud(bonds, i, points, law, state, linear, third, energy):
    energy_of(bonds, i, points, law, state, linear, third, energy)


@implements(family.energy_row, LatticeShares)
def _energy_row_of_lattice(bonds, i, points, law, state, linear, third, energy):
    energy_of_eight(bonds.bonds, bonds, i, points, law, state, linear, third, energy)


@implements(family.frequency_row, CloudShares)
def _frequency_row_of_cloud(bonds, i, points, law, state, third):
    return frequency_of(bonds, i, points, law, state, third)


@implements(family.frequency_row, LatticeShares)
def _frequency_row_of_lattice(bonds, i, points, law, state, third):
    return frequency_of_eight(bonds.bonds, bonds, i, points, law, state, third)
