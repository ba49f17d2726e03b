"""Bonds of particles on a square or cubic lattice: the same neighbours for all (a stencil), a bit for each bond, eight particles at a time.

Particles lie on a padded grid, each component of a field together; a block of eight slots along the fastest axis is summed in registers over the whole
stencil, so that nothing is scattered and a particle's force has the same bits on any rank. The order of the stencil is that of the neighbours' ids,
whatever the axes of the grid. Outlines, holes and cracks are bits that are not set; blocks without a particle are not visited.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements, inlined
from pdhpc.kernels import family
from pdhpc.kernels.family import MIXED
from pdhpc.kernels.simd import LANES, any_of, as_vector, fma, has_bit, lane_max, larger, load8, lookup8, root8, rsqrt8, select, splat, store8, words8
from pdhpc.materials.bond_based import BondBasedLaw
from pdhpc.kernels.reference import frequency_of
from pdhpc.materials.law import pull, stiffness
from pdhpc.materials.state_based import LinearSolidLaw

WORD = 64
"""Bonds in a word of states."""


class LatticeArrays(NamedTuple):
    """The stencil of a lattice and the states of its bonds.

    offset (n,) int64, slots from a particle to its neighbours; vector (n, dim), m, xi; inv_length (n,), 1/m; weight (n,): bond_weight times the volume of a
    cell; dilatation_weight (n,): weight |xi|^2; alive (n_words, n_slots) uint64: bit k & 63 of word k >> 6 of a slot is bond k; kind (n_slots / 8,) uint8: the
    block (of material and failure rule) of all particles of a block of eight and their neighbours, or MIXED;
    step, cells (3,) int64: slots between cells along x, y, z, and their number; coordinate (3, ...), m: those of the cells along each (z of 2D: one 0).
    """

    offset: np.ndarray
    vector: np.ndarray
    inv_length: np.ndarray
    weight: np.ndarray
    dilatation_weight: np.ndarray
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
    return i + bonds.offset[k]


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
    return bonds.inv_length[k]


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


@implements(family.row_width, LatticeArrays)
def _row_width(bonds):
    return LANES


@inlined
def count_bits(word):
    """Return the number of set bits of a uint64."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@implements(family.force_row, LatticeArrays)
def _force_row(bonds, i, points, law, state, linear, third, force_density):
    kind = bonds.kind[i >> 3]
    if kind == MIXED:
        return _block_force(bonds, i, points, law, state, linear, third, force_density, mixed_ends(law, state, i), _smallest(law.break_at))
    return _block_force(bonds, i, points, law, state, linear, third, force_density, uniform_ends(law, state, i, kind), law.break_at[kind, kind])


@inlined
def _block_force(bonds, i, points, law, state, linear, third, force_density, near, limit):
    """Sum the forces on eight particles; near: what the law needs of them."""
    position, n, count = points.position, len(points.position), len(bonds.offset)
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    fx, fy, fz, largest = splat(0.0), splat(0.0), splat(0.0), splat(-1.0)
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            j = i + bonds.offset[k]
            measure, stretch, shrink, dx, dy, dz = _strains(bonds, position, j, k, px, py, pz, linear, third)
            ends = bond_ends(near, points, state, i, j)
            live = has_bit(states, k - WORD * word)
            tension = select(live, pull(law, ends[0], ends[1], bonds.weight[k], stretch, shrink), splat(0.0))
            largest = select(live, larger(measure, largest), largest)
            fx, fy = fma(tension, dx, fx), fma(tension, dy, fy)
            if third is not None:
                fz = fma(tension, dz, fz)
    store8(force_density, i, fx)
    store8(force_density, n + i, fy)
    if third is not None:
        store8(force_density, 2 * n + i, fz)
    return any_of(largest > limit)


@implements(family.dilatation_row, LatticeArrays)
def _dilatation_row(bonds, i, points, law, state, linear, third):
    kind = bonds.kind[i >> 3]
    position, n, count = points.position, len(points.position), len(bonds.offset)
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    total, largest = splat(0.0), splat(-1.0)
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            measure, stretch, shrink, dx, dy, dz = _strains(bonds, position, i + bonds.offset[k], k, px, py, pz, linear, third)
            live = has_bit(states, k - WORD * word)
            extension = measure if linear else root8(measure) - 1.0
            total = fma(select(live, extension, splat(0.0)), splat(bonds.dilatation_weight[k]), total)
            largest = select(live, larger(measure, largest), largest)
    a = load8(state, i)
    p = a * a * total
    if kind == MIXED:
        for lane in range(LANES):
            state[i + lane, 1] = 0.0
        store8(state, n + i, p)
        for lane in range(LANES):
            block = points.block[i + lane]
            state[i + lane, 1] *= law.volumetric[block] if block < len(law.volumetric) else 0.0
        return any_of(largest > _smallest(law.break_at))
    store8(state, n + i, p * law.volumetric[kind])
    return any_of(largest > law.break_at[kind, kind])


@implements(family.frequency_row, LatticeArrays)
def _frequency_row(bonds, i, points, law, state, third):
    kind, largest = bonds.kind[i >> 3], 0.0
    if kind == MIXED:
        for lane in range(LANES):
            largest = max(largest, frequency_of(bonds, i + lane, points, law, state, third))
        return largest
    near, n, count = uniform_ends(law, state, i, kind), len(points.position), len(bonds.offset)
    xx, yy, zz, xy, xz, yz = splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            ends = bond_ends(near, points, state, i, i + bonds.offset[k])
            x, y, z = bonds.vector[k, 0], bonds.vector[k, 1], 0.0 if third is None else bonds.vector[k, 2]
            part = select(has_bit(states, k - WORD * word), as_vector(stiffness(law, kind, ends[0], ends[1])), splat(0.0))
            part = part * (bonds.weight[k] * bonds.inv_length[k] * bonds.inv_length[k])
            xx, yy, zz = fma(part, splat(x * x), xx), fma(part, splat(y * y), yy), fma(part, splat(z * z), zz)
            xy, xz, yz = fma(part, splat(x * y), xy), fma(part, splat(x * z), xz), fma(part, splat(y * z), yz)
    xy, xz, yz = larger(xy, 0.0 - xy), larger(xz, 0.0 - xz), larger(yz, 0.0 - yz)
    norm = larger(larger(xx + xy + xz, yy + xy + yz), zz + xz + yz)
    return lane_max(norm) / law.density[kind]


@inlined
def _strains(bonds, position, j, k, px, py, pz, linear, third):
    """Return (measure, stretch, shrink, dx, dy, dz) of bond k of eight particles, as family.bond_strain does of one; j is the slot of the first's neighbour."""
    n, inv_l = len(position), bonds.inv_length[k]
    ex, ey = load8(position, j) - px, load8(position, n + j) - py
    ez = splat(0.0) if third is None else load8(position, 2 * n + j) - pz
    dx, dy, dz = ex, ey, ez
    if linear:
        dx, dy = splat(bonds.vector[k, 0]), splat(bonds.vector[k, 1])
        dz = splat(0.0) if third is None else splat(bonds.vector[k, 2])
    along2 = fma(dx, ex, dy * ey) if third is None else fma(dx, ex, fma(dy, ey, dz * ez))
    measure = along2 * (inv_l * inv_l)
    shrink = splat(1.0) if linear else rsqrt8(measure)
    return measure, measure if linear else 1.0 - shrink, shrink, dx, dy, dz


@inlined
def _smallest(table):
    """Return the smallest entry of a small table."""
    least = np.inf
    for a in range(table.shape[0]):
        for b in range(table.shape[1]):
            least = min(least, table[a, b])
    return least


class OneModulus(NamedTuple):
    """Eight particles whose bonds share a micromodulus."""

    micromodulus: float


class TableOfModuli(NamedTuple):
    """Eight particles whose bonds have the micromoduli of a table by block."""

    micromodulus: np.ndarray


class States(NamedTuple):
    """(a, p) of eight particles of a state-based law, vectors."""

    a: object
    p: object


def uniform_ends(law, state, i, kind):
    """Return what the law needs of eight particles which, with their neighbours, are of block `kind`."""


def mixed_ends(law, state, i):
    """Return what the law needs of eight particles which, with their neighbours, are of several blocks."""


def bond_ends(near, points, state, i, j):
    """Return (near, far) of the law's `pull` for one bond of eight particles; j is the slot of the first's neighbour."""


@implements(uniform_ends, BondBasedLaw)
def _one_modulus(law, state, i, kind):
    return OneModulus(law.micromodulus[kind, kind])


@implements(mixed_ends, BondBasedLaw)
def _table_of_moduli(law, state, i):
    return TableOfModuli(law.micromodulus)


@implements(uniform_ends, LinearSolidLaw)
def _uniform_states(law, state, i, kind):
    return States(load8(state, i), load8(state, len(state) + i))


@implements(mixed_ends, LinearSolidLaw)
def _mixed_states(law, state, i):
    return States(load8(state, i), load8(state, len(state) + i))


@implements(bond_ends, OneModulus)
def _ends_of_one_modulus(near, points, state, i, j):
    return near.micromodulus, 0.0


@implements(bond_ends, TableOfModuli)
def _ends_of_table(near, points, state, i, j):
    return lookup8(near.micromodulus, points.block, i, points.block, j), 0.0


@implements(bond_ends, States)
def _ends_of_states(near, points, state, i, j):
    return (near.a, near.p), (load8(state, j), load8(state, len(state) + j))
