"""Bonds of a general cloud of particles (compressed rows, full list: each particle sums all of its own bonds), eight bonds at a time.

Each row is summed by one thread of control over slots sorted by global id, so a particle's force has the same bits on any rank that owns it. Rows of
several blocks (MIXED) go bond by bond (kernels/reference.py); those of several volumes (VARIED) look each neighbour's up.
"""
import numpy as np

from pdhpc.jit import implements, inlined
from pdhpc.kernels import family, reference
from pdhpc.kernels.failure import beyond_of_eight, limit_of_block, limit_of_eight, strained_of_eight
from pdhpc.kernels.family import MIXED, VARIED
from pdhpc.kernels.neighbours import BondArrays, CorrectedArrays
from pdhpc.kernels.simd import (
    LANES, any_of, at, both, either, fma, gather8, gather_xy, gather_xyz, lane_mask, lane_max, lane_sum, larger, load8, root8, rsqrt8, select, splat,
)
from pdhpc.materials.bond_based import BondBasedLaw
from pdhpc.materials.law import bond_weight, moment_weight, near_end, pull, weighting_between
from pdhpc.materials.state_based import LinearSolidLaw

_BITS = np.array([bin(byte).count("1") for byte in range(256)], dtype=np.uint8)


def _store(record):
    """Let rows of neighbours answer what sweeps ask of bonds."""

    @implements(family.first_bond, record)
    def _first_bond(bonds, i):
        return bonds.row_start[i]

    @implements(family.end_of_bonds, record)
    def _end_of_bonds(bonds, i):
        return bonds.row_start[i + 1]

    @implements(family.neighbour, record)
    def _neighbour(bonds, i, k):
        return bonds.neighbour[k]

    @implements(family.is_alive, record)
    def _is_alive(bonds, i, k):
        return (bonds.alive[k >> 3] >> np.uint8(k & 7)) & np.uint8(1) != 0

    @implements(family.break_bond, record)
    def _break_bond(bonds, i, k):
        bonds.alive[k >> 3] &= ~np.uint8(1 << (k & 7))

    @implements(family.count_alive, record)
    def _count_alive(bonds, i):
        """Rows fill whole bytes."""
        total = 0
        for byte in range(bonds.row_start[i] >> 3, bonds.row_start[i + 1] >> 3):
            total += _BITS[bonds.alive[byte]]
        return total

    @implements(family.inverse_length, record)
    def _inverse_length(bonds, i, k):
        return bonds.inv_length[k]

    @implements(family.reference_vector, record)
    def _reference_vector(bonds, points, i, j, k, third):
        dz = 0.0 if third is None else points.reference[j, 2] - points.reference[i, 2]
        return points.reference[j, 0] - points.reference[i, 0], points.reference[j, 1] - points.reference[i, 1], dz

    @implements(family.place, record)
    def _place(bonds, points, i):
        return points.reference[i, 0], points.reference[i, 1], points.reference[i, 2] if points.reference.shape[1] > 2 else 0.0

    @implements(family.row_width, record)
    def _row_width(bonds):
        return 1

    @implements(family.over_mass, record)
    def _over_mass(bonds, i):
        return 1.0

    @implements(family.over_energy, record)
    def _over_energy(bonds, i):
        return 1.0

    @implements(family.force_row, record)
    def _force_row(bonds, i, points, law, state, linear, third, force_density):
        if points.row_block[i] == MIXED:
            return reference.force_on(bonds, i, points, law, state, linear, third, force_density)
        if points.row_block[i] == VARIED:
            return force_of_row(bonds, None, points.volume, i, points, law, state, linear, third, force_density)
        return force_of_row(bonds, None, None, i, points, law, state, linear, third, force_density)

    @implements(family.dilatation_row, record)
    def _dilatation_row(bonds, i, points, law, state, linear, third):
        if points.row_block[i] == MIXED:
            return reference.dilatation_of(bonds, i, points, law, state, linear, third)
        if points.row_block[i] == VARIED:
            return dilatation_of_row(bonds, None, points.volume, i, points, law, state, linear, third)
        return dilatation_of_row(bonds, None, None, i, points, law, state, linear, third)

    @implements(family.energy_row, record)
    def _energy_row(bonds, i, points, law, state, linear, third, energy):
        reference.energy_of(bonds, i, points, law, state, linear, third, energy)

    @implements(family.raised_row, record)
    def _raised_row(bonds, i, points, softening, linear, third):
        most = splat(0.0 if linear is not None else -1.0)  # of minus the measures, and that of an unstretched bond
        for k in range(bonds.row_start[i], bonds.row_start[i + 1], LANES):
            measure, stretch, shrink, dx, dy, dz = _strains(bonds, i, k, points, load8(bonds.inv_length, k), linear, third)
            most = larger(most, select(lane_mask(at(bonds.alive, k >> 3)), 0.0 - measure, most))
        points.raised[i] = family.raise_of(points, i, softening, 0.0 - lane_max(most), linear)

    @implements(family.frequency_row, record)
    def _frequency_row(bonds, i, points, law, state, third):
        return reference.frequency_of(bonds, i, points, law, state, third)


for _record in (BondArrays, CorrectedArrays):
    _store(_record)


def corrected(bonds, k, tension):
    """Return the pulls of eight bonds from slot k on with the surface correction of the storage."""


@implements(family.share, BondArrays)
def _share(bonds, i, k):
    return 1.0


@implements(corrected, BondArrays)
def _not_corrected(bonds, k, tension):
    return tension


@implements(family.share, CorrectedArrays)
def _surface_factor(bonds, i, k):
    return bonds.factor[k]


@implements(corrected, CorrectedArrays)
def _corrected(bonds, k, tension):
    return tension * load8(bonds.factor, k)


@inlined
def force_of_row(bonds, shares, volumes, i, points, law, state, linear, third, force_density):
    """Sum the forces on a particle, of bonds shared as `shares` (shared.CloudShares) says, or of whole ones (None).

    volumes : of all particles, where those of the row differ; None where they are its own.
    """
    block = points.block[i]
    near = near_end(law, points, state, i, i)
    fx, fy, fz, beyond = splat(0.0), splat(0.0), splat(0.0), lane_mask(np.uint8(0))
    limit, weighting = limit_of_block(law.failure, law, block), weighting_between(law.weighting, block, block)
    for k in range(bonds.row_start[i], bonds.row_start[i + 1], LANES):
        live = lane_mask(at(bonds.alive, k >> 3))
        inv_l = load8(bonds.inv_length, k)
        measure, stretch, shrink, dx, dy, dz = _strains(bonds, i, k, points, inv_l, linear, third)
        far = far_ends(law, state, bonds, k)
        tension = corrected(bonds, k, pull(law, near, far, bond_weight(law, weighting, inv_l), stretch, shrink))
        limits = limit_of_eight(law.failure, limit, points, i, bonds.neighbour, k, linear)
        beyond = either(beyond, both(live, beyond_of_eight(law.failure, law, limits, weighting, near, far, inv_l, measure, linear)))
        if shares is not None:
            tension = tension * load8(shares.weight, shares.row_start[shares.row[i]] + k - bonds.row_start[i])
        if volumes is not None:
            tension = tension * gather8(volumes, bonds.neighbour, k)
        fx, fy = select(live, fma(tension, dx, fx), fx), select(live, fma(tension, dy, fy), fy)
        if third is not None:
            fz = select(live, fma(tension, dz, fz), fz)
    volume = points.volume[i] if volumes is None else 1.0
    if shares is not None:
        volume = volume * shares.over_mass[shares.row[i]]
    force_density[i, 0] = lane_sum(fx) * volume
    force_density[i, 1] = lane_sum(fy) * volume
    if third is not None:
        force_density[i, 2] = lane_sum(fz) * volume
    return any_of(beyond)


@inlined
def dilatation_of_row(bonds, shares, volumes, i, points, law, state, linear, third):
    """Set p of a particle; `shares` and `volumes` as of force_of_row."""
    block = points.block[i]
    total, beyond = splat(0.0), lane_mask(np.uint8(0))
    limit, weighting = limit_of_block(law.failure, law, block), weighting_between(law.weighting, block, block)
    for k in range(bonds.row_start[i], bonds.row_start[i + 1], LANES):
        live = lane_mask(at(bonds.alive, k >> 3))
        inv_l = load8(bonds.inv_length, k)
        measure, stretch, shrink, dx, dy, dz = _strains(bonds, i, k, points, inv_l, linear, third)
        extension = measure if linear is not None else root8(measure) - 1.0
        if shares is not None:
            extension = extension * load8(shares.weight, shares.row_start[shares.row[i]] + k - bonds.row_start[i])
        if volumes is not None:
            extension = extension * gather8(volumes, bonds.neighbour, k)
        total = select(live, fma(moment_weight(law, weighting, inv_l), extension, total), total)
        limits = limit_of_eight(law.failure, limit, points, i, bonds.neighbour, k, linear)
        beyond = either(beyond, both(live, strained_of_eight(law.failure, limits, measure)))
    volume = points.volume[i] if volumes is None else 1.0
    if shares is not None:
        volume = volume * shares.over_energy[shares.row[i]]
    state[i, 1] = law.volumetric[block] * state[i, 0] * state[i, 0] * lane_sum(total) * volume
    return any_of(beyond)


@inlined
def _strains(bonds, i, k, points, inv_l, linear, third):
    """Return (measure, stretch, shrink, dx, dy, dz) of eight bonds, as family.bond_strain does of one."""
    if third is None:
        ex, ey = _offsets_2d(points.position, bonds.neighbour, i, k)
        dx, dy = _offsets_2d(points.reference, bonds.neighbour, i, k) if linear is not None else (ex, ey)
        dz, along2 = splat(0.0), fma(dx, ex, dy * ey)
    else:
        ex, ey, ez = _offsets_3d(points.position, bonds.neighbour, i, k)
        dx, dy, dz = _offsets_3d(points.reference, bonds.neighbour, i, k) if linear is not None else (ex, ey, ez)
        along2 = fma(dx, ex, fma(dy, ey, dz * ez))
    measure = along2 * (inv_l * inv_l)
    shrink = splat(1.0) if linear is not None else rsqrt8(measure)
    return measure, measure if linear is not None else 1.0 - shrink, shrink, dx, dy, dz


@inlined
def _offsets_2d(table, neighbour, i, k):
    """Return (x, y) of eight neighbours relative to particle i."""
    x, y = gather_xy(table, neighbour, k)
    return x - table[i, 0], y - table[i, 1]


@inlined
def _offsets_3d(table, neighbour, i, k):
    """Return (x, y, z) of eight neighbours relative to particle i."""
    x, y, z = gather_xyz(table, neighbour, k)
    return x - table[i, 0], y - table[i, 1], z - table[i, 2]


def far_ends(law, state, bonds, k):
    """Return what the law's `pull` needs of the neighbours in the slots k ... k + 7."""


@implements(far_ends, BondBasedLaw)
def _far_ends_bond_based(law, state, bonds, k):
    return 0.0


@implements(far_ends, LinearSolidLaw)
def _far_ends_linear_solid(law, state, bonds, k):
    return gather_xy(state, bonds.neighbour, k)
