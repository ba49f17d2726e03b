"""Bonds of particles on a square or cubic lattice: the same neighbours for all (a stencil), a bit for each bond, eight particles at a time.

Particles lie on a padded grid, each component of a field together; a block of eight slots along the fastest axis is summed in registers over the whole
stencil, so that nothing is scattered and a particle's force has the same bits on any rank. The order of the stencil is that of the neighbours' ids,
whatever the axes of the grid. Outlines, holes and cracks are bits that are not set; blocks without a particle are not visited.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements, inlined
from pdhpc.kernels import family
from pdhpc.kernels.failure import trigger_of_eight
from pdhpc.kernels.family import MIXED
from pdhpc.kernels.lattice_laws import OneBlock, SeveralBlocks, bond_moduli, bound_of, far_end_of, mixed_ends, near_end_of, per_block, spherical_of, uniform_ends
from pdhpc.kernels.simd import (
    LANES, any_of, as_vector, at, both, either, fma, fnma, has_bit, lane_mask, lane_max, larger, load8, pick8, root8, rsqrt8, select, splat, store8, words8,
)
from pdhpc.materials.law import bond_energy, moduli, volume_energy

WORD = 64
"""Bonds in a word of states."""


class LatticeArrays(NamedTuple):
    """The stencil of a lattice and the states of its bonds.

    offset (n,) int64, slots from a particle to its neighbours; vector (n, dim), m, xi; length, inv_length (n,), |xi|, m, and its inverse;
    weight, weight_length (n_block + 1, n): bond_weight times the volume of a cell, times the modulus of bonds within each block (laws that have one), and last alone; and
    the same times |xi|;
    moment_weight (n,), of materials/law.py, times the volume; trigger (n_block + 1, n): y^2 (finite) or xi . eta (linear), m^2, from which on a bond of a
    block, or last of any, may be beyond its limit (a little early: what decides is family.bond_strain); alive (n_words, n_slots) uint64: bit k & 63 of word k >> 6 of a slot is bond k; kind (n_slots / 8,) uint8: the
    block (of material and failure rule) of all particles of a block of eight and their neighbours, or MIXED;
    step, cells (3,) int64: slots between cells along x, y, z, and their number; coordinate (3, ...), m: those of the cells along each (z of 2D: one 0).
    """

    offset: np.ndarray
    vector: np.ndarray
    length: np.ndarray
    inv_length: np.ndarray
    weight: np.ndarray
    weight_length: np.ndarray
    moment_weight: np.ndarray
    trigger: np.ndarray
    alive: np.ndarray
    kind: np.ndarray
    step: np.ndarray
    cells: np.ndarray
    coordinate: np.ndarray


@implements(family.first_bond, LatticeArrays)
def _first_bond(bonds, i):
    return 0


@implements(family.end_of_bonds, LatticeArrays)
def _end_of_bonds(bonds, i):
    return len(bonds.offset)


@implements(family.neighbour, LatticeArrays)
def _neighbour(bonds, i, k):
    return i + at(bonds.offset, k)


@implements(family.is_alive, LatticeArrays)
def _is_alive(bonds, i, k):
    return (bonds.alive[k >> 6, i] >> np.uint64(k & 63)) & np.uint64(1) != np.uint64(0)


@implements(family.break_bond, LatticeArrays)
def _break_bond(bonds, i, k):
    bonds.alive[k >> 6, i] &= ~(np.uint64(1) << np.uint64(k & 63))


@implements(family.count_alive, LatticeArrays)
def _count_alive(bonds, i):
    total = 0
    for word in range(bonds.alive.shape[0]):
        total += count_bits(bonds.alive[word, i])
    return total


@implements(family.inverse_length, LatticeArrays)
def _inverse_length(bonds, i, k):
    return at(bonds.inv_length, k)


@implements(family.reference_vector, LatticeArrays)
def _reference_vector(bonds, points, i, j, k, third):
    return bonds.vector[k, 0], bonds.vector[k, 1], 0.0 if third is None else bonds.vector[k, 2]


@implements(family.place, LatticeArrays)
def _place(bonds, points, i):
    x = bonds.coordinate[0, i // bonds.step[0] % bonds.cells[0]]
    y = bonds.coordinate[1, i // bonds.step[1] % bonds.cells[1]]
    return x, y, bonds.coordinate[2, i // bonds.step[2] % bonds.cells[2]]


@implements(family.share, LatticeArrays)
def _share(bonds, i, k):
    return 1.0


@implements(family.over_mass, LatticeArrays)
def _over_mass(bonds, i):
    return 1.0


@implements(family.over_energy, LatticeArrays)
def _over_energy(bonds, i):
    return 1.0


@implements(family.row_width, LatticeArrays)
def _row_width(bonds):
    return LANES


@inlined
def weight_of_eight(shares, i, k):
    """Return the weights of bond k of eight particles."""
    return load8(shares.weight, LANES * (shares.row[i >> 3] * len(shares.bonds.offset) + k))


@inlined
def over_mass_of_eight(shares, i):
    """Return one over the mass shares of eight particles."""
    return load8(shares.over_mass, LANES * shares.row[i >> 3])


@inlined
def over_energy_of_eight(shares, i):
    """Return one over the energy shares of eight particles."""
    return load8(shares.over_energy, LANES * shares.row[i >> 3])


@inlined
def count_bits(word):
    """Return the number of set bits of a uint64."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@implements(family.force_row, LatticeArrays)
def _force_row(bonds, i, points, law, state, linear, third, force_density):
    return force_of_eight(bonds, None, i, points, law, state, linear, third, force_density)


@inlined
def force_of_eight(bonds, shares, i, points, law, state, linear, third, force_density):
    """Sum the forces on eight particles, of bonds shared as `shares` (shared.LatticeShares) says, or of whole ones (None)."""
    kind = bonds.kind[i >> 3]
    if kind == MIXED:
        return _block_force(bonds, shares, i, points, law, state, linear, third, force_density, mixed_ends(law, state, i), len(bonds.weight) - 1)
    return _block_force(bonds, shares, i, points, law, state, linear, third, force_density, uniform_ends(law, state, i), np.int64(kind))


@inlined
def _block_force(bonds, shares, i, points, law, state, linear, third, force_density, near, row):
    """Sum the forces on eight particles; near: what the law needs of them; row: of the tables of weights and triggers."""
    position, n, count = points.position, len(points.position), len(bonds.offset)
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    fx, fy, fz, beyond = splat(0.0), splat(0.0), splat(0.0), lane_mask(np.uint8(0))
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            j = i + at(bonds.offset, k)
            along2, dx, dy, dz = _vectors(bonds, position, j, k, px, py, pz, linear, third)
            live = has_bit(states, k - WORD * word)
            beyond = either(beyond, both(live, along2 > trigger_of_eight(law.failure, bonds, points, i, j, row, k, linear)))
            c, p = bond_moduli(near, law, points, state, i, j)
            if linear is not None:
                weight, stretch = at(bonds.weight, row * count + k), along2 * (at(bonds.inv_length, k) * at(bonds.inv_length, k))
                tension = fma(as_vector(weight * c), stretch, as_vector(weight * p))
            else:  # weight (C (1 - |xi|/|y|) + P |xi|/|y|)
                tension = fnma(as_vector(at(bonds.weight_length, row * count + k) * (c - p)), rsqrt8(along2), as_vector(at(bonds.weight, row * count + k) * c))
            tension = select(live, tension, splat(0.0))
            if shares is not None:
                tension = tension * weight_of_eight(shares, i, k)
            fx, fy = fma(tension, dx, fx), fma(tension, dy, fy)
            if third is not None:
                fz = fma(tension, dz, fz)
    if shares is not None:
        over = over_mass_of_eight(shares, i)
        fx, fy, fz = fx * over, fy * over, fz * over
    store8(force_density, i, fx)
    store8(force_density, n + i, fy)
    if third is not None:
        store8(force_density, 2 * n + i, fz)
    return any_of(beyond)


@implements(family.dilatation_row, LatticeArrays)
def _dilatation_row(bonds, i, points, law, state, linear, third):
    return dilatation_of_eight(bonds, None, i, points, law, state, linear, third)


@inlined
def dilatation_of_eight(bonds, shares, i, points, law, state, linear, third):
    """Set p of eight particles; `shares` as of force_of_eight."""
    kind = bonds.kind[i >> 3]
    row = len(bonds.weight) - 1 if kind == MIXED else np.int64(kind)
    position, n, count = points.position, len(points.position), len(bonds.offset)
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    total, beyond = splat(0.0), lane_mask(np.uint8(0))
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            j = i + at(bonds.offset, k)
            along2, dx, dy, dz = _vectors(bonds, position, j, k, px, py, pz, linear, third)
            live = has_bit(states, k - WORD * word)
            beyond = either(beyond, both(live, along2 > trigger_of_eight(law.failure, bonds, points, i, j, row, k, linear)))
            s = select(live, _stretches(bonds, k, along2, linear), splat(0.0))
            if shares is not None:
                s = s * weight_of_eight(shares, i, k)
            total = fma(s, splat(at(bonds.moment_weight, k)), total)
    if shares is not None:
        total = total * over_energy_of_eight(shares, i)
    a = load8(state, i)
    if kind == MIXED:
        store8(state, n + i, a * a * total * pick8(law.volumetric, points.block, i))
    else:
        store8(state, n + i, a * a * total * law.volumetric[kind])
    return any_of(beyond)


@inlined
def _vectors(bonds, position, j, k, px, py, pz, linear, third):
    """Return (y^2 or xi . eta, m^2, and the components, m, of the vectors that bonds pull along) of bond k of eight particles, as family.bond_strain does."""
    n = len(position)
    ex, ey = load8(position, j) - px, load8(position, n + j) - py
    ez = splat(0.0) if third is None else load8(position, 2 * n + j) - pz
    dx, dy, dz = ex, ey, ez
    if linear is not None:
        dim = 2 if third is None else 3
        dx, dy = splat(at(bonds.vector, dim * k)), splat(at(bonds.vector, dim * k + 1))
        dz = splat(0.0) if third is None else splat(at(bonds.vector, dim * k + 2))
    return fma(dx, ex, dy * ey) if third is None else fma(dx, ex, fma(dy, ey, dz * ez)), dx, dy, dz


@implements(family.energy_row, LatticeArrays)
def _energy_row(bonds, i, points, law, state, linear, third, energy):
    energy_of_eight(bonds, None, i, points, law, state, linear, third, energy)


@inlined
def energy_of_eight(bonds, shares, i, points, law, state, linear, third, energy):
    """Store the energy densities of eight particles; `shares` as of force_of_eight."""
    kind = bonds.kind[i >> 3]
    if kind == MIXED:
        _block_energy(SeveralBlocks(0), bonds, shares, i, points, law, state, linear, third, energy)
    else:
        _block_energy(OneBlock(kind), bonds, shares, i, points, law, state, linear, third, energy)


@inlined
def _block_energy(which, bonds, shares, i, points, law, state, linear, third, energy):
    """Store the energy densities of eight particles."""
    position, n, count = points.position, len(points.position), len(bonds.offset)
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    total, extended = splat(0.0), splat(0.0)
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            j = i + at(bonds.offset, k)
            along2, dx, dy, dz = _vectors(bonds, position, j, k, px, py, pz, linear, third)
            s = _stretches(bonds, k, along2, linear)
            moment = select(has_bit(states, k - WORD * word), splat(at(bonds.moment_weight, k)), splat(0.0))
            if shares is not None:
                moment = moment * weight_of_eight(shares, i, k)
            total, extended = total + bond_energy(law, near_end_of(law, which, points, state, i, j), moment, s), fma(moment, s, extended)
    beside = as_vector(volume_energy(law, near_end_of(law, which, points, state, i, i), spherical_of(law, which, points, i), extended))
    if shares is not None:
        beside = beside * over_energy_of_eight(shares, i)
    store8(energy, i, total + beside)


@inlined
def _stretches(bonds, k, along2, linear):
    """Return s of bond k of eight particles from what _vectors says first."""
    if linear is not None:
        return along2 * (at(bonds.inv_length, k) * at(bonds.inv_length, k))
    return fma(root8(along2), splat(at(bonds.inv_length, k)), splat(-1.0))


@implements(family.raised_row, LatticeArrays)
def _raised_row(bonds, i, points, softening, linear, third):
    position, n, count = points.position, len(points.position), len(bonds.offset)
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    most = splat(0.0 if linear is not None else -1.0)  # of minus the measures, and that of an unstretched bond
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            along2, dx, dy, dz = _vectors(bonds, position, i + at(bonds.offset, k), k, px, py, pz, linear, third)
            measure = along2 * (at(bonds.inv_length, k) * at(bonds.inv_length, k))
            most = larger(most, select(has_bit(states, k - WORD * word), 0.0 - measure, most))
    store8(points.raised, i, most)
    for lane in range(i, i + LANES):
        points.raised[lane] = family.raise_of(points, lane, softening, 0.0 - points.raised[lane], linear)


@implements(family.frequency_row, LatticeArrays)
def _frequency_row(bonds, i, points, law, state, third):
    return frequency_of_eight(bonds, None, i, points, law, state, third)


@inlined
def frequency_of_eight(bonds, shares, i, points, law, state, third):
    """Return the largest |A|/rho of eight particles; `shares` as of force_of_eight."""
    kind = bonds.kind[i >> 3]
    if kind == MIXED:
        return _block_frequency(SeveralBlocks(0), bonds, shares, i, points, law, state, third)
    return _block_frequency(OneBlock(kind), bonds, shares, i, points, law, state, third)


@inlined
def _block_frequency(which, bonds, shares, i, points, law, state, third):
    """Return the largest |A|/rho of eight particles."""
    n, count, plain = len(points.position), len(bonds.offset), len(bonds.weight) - 1
    bound = bound_of(law, which, points, i)
    xx, yy, zz, xy, xz, yz = splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            j = i + at(bonds.offset, k)
            c, p = moduli(law, near_end_of(law, which, points, state, i, j), far_end_of(law, state, j))
            x, y, z = bonds.vector[k, 0], bonds.vector[k, 1], 0.0 if third is None else bonds.vector[k, 2]
            part = select(has_bit(states, k - WORD * word), as_vector(c * bound), splat(0.0))
            part = part * (bonds.weight[plain, k] * at(bonds.inv_length, k) * at(bonds.inv_length, k))
            if shares is not None:
                part = part * weight_of_eight(shares, i, k)
            xx, yy, zz = fma(part, splat(x * x), xx), fma(part, splat(y * y), yy), fma(part, splat(z * z), zz)
            xy, xz, yz = fma(part, splat(x * y), xy), fma(part, splat(x * z), xz), fma(part, splat(y * z), yz)
    xy, xz, yz = larger(xy, 0.0 - xy), larger(xz, 0.0 - xz), larger(yz, 0.0 - yz)
    norm = larger(larger(xx + xy + xz, yy + xy + yz), zz + xz + yz)
    if shares is not None:
        norm = norm * over_mass_of_eight(shares, i)
    return lane_max(norm / per_block(which, law.density, points, i))
