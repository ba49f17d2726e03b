"""Loops over the overlap of two regions and the strip of particles around it: who is near, what responds to the multipliers, which bonds both copies keep.

A strip is a list of slots; compact arrays (n, dim) hold its particles in this order.
"""
import numpy as np

from pdhpc.jit import implements, kernel, sweep
from pdhpc.kernels.cloud import BondArrays
from pdhpc.kernels.family import break_bond, bond_strain, end_of_bonds, first_bond, inverse_length, is_alive, neighbour, over_mass, share
from pdhpc.kernels.lattice import LatticeArrays
from pdhpc.materials.law import bond_energy, bond_weight, far_end, moduli, moment_weight, near_end


@kernel
def spread_marks(bonds, slots, marked, result):
    """Set result[i, 0] = 1 for the particles in `slots` that are marked (marked (n_slots, 1) > 0) or have a bond to one that is."""
    for n in range(len(slots)):
        i = slots[n]
        found = marked[i, 0] > 0.0
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if found:
                break
            found = is_alive(bonds, i, k) and marked[neighbour(bonds, i, k), 0] > 0.0
        result[i, 0] = 1.0 if found else 0.0


@kernel
def put_rows(field, slots, values):
    """field[slots] = values (n, dim)."""
    for n in range(len(slots)):
        for d in range(values.shape[1]):
            field[slots[n], d] = values[n, d]


@kernel
def take_rows(field, slots, values, first):
    """values[:, first : first + dim] = field[slots]."""
    for n in range(len(slots)):
        for d in range(field.shape[1]):
            values[n, first + d] = field[slots[n], d]


@kernel
def clear_rows(field, slots, dim):
    """field[slots] = 0."""
    for n in range(len(slots)):
        for d in range(dim):
            field[slots[n], d] = 0.0


@kernel
def add_rows(field, slots, factor, source, by_block, block):
    """field += factor by_block[block] source in `slots`; source by slot too; by_block (256,)."""
    for n in range(len(slots)):
        i = slots[n]
        for d in range(field.shape[1]):
            field[i, d] += factor * by_block[block[i]] * source[i, d]


@kernel
def accelerate_rows(field, slots, factor, force_density, inverse_density, block, held):
    """field = factor f / rho in `slots`; 0 where held (n, dim)."""
    for n in range(len(slots)):
        i = slots[n]
        for d in range(force_density.shape[1]):
            field[i, d] = 0.0 if held[n, d] else factor * inverse_density[block[i]] * force_density[i, d]


@kernel
def drift_response(field, slots, u, v, a, dt):
    """u += dt v + dt^2/2 a of compact arrays, and field[slots] = u."""
    for n in range(len(slots)):
        for d in range(u.shape[1]):
            u[n, d] += dt * (v[n, d] + 0.5 * dt * a[n, d])
            field[slots[n], d] = u[n, d]


@kernel
def kick_response(load, fraction, force_density, slots, inverse_density, block, held, v, a, dt, moved):
    """a' = fraction load + f/rho (0 where held; f only where the strip has `moved`), v += dt/2 (a + a'), a = a' of compact arrays."""
    for n in range(len(slots)):
        i = slots[n]
        for d in range(v.shape[1]):
            new = fraction * load[n, d]
            if moved:
                new += inverse_density[block[i]] * force_density[i, d]
            new = 0.0 if held[n, d] else new
            v[n, d] += 0.5 * dt * (a[n, d] + new)
            a[n, d] = new


@kernel
def add_response(field, slots, values, by_block, block):
    """field[slots] += by_block[block] values (n, dim)."""
    for n in range(len(slots)):
        for d in range(values.shape[1]):
            field[slots[n], d] += by_block[block[slots[n]]] * values[n, d]


def words_of(bonds, most):
    """Return the number of 64-bit words that hold a state for each bond of a particle. Local; most: of the slots of a row of a cloud."""
    return bonds.alive.shape[0] if isinstance(bonds, LatticeArrays) else -(-most // 64)


def common_bonds(bonds, slots, inside, words):
    """Set the bit of every bond of the particles in `slots` to a particle inside (n_slots,) bool, in words (n, n_words) uint64, on the same place in both copies."""


def intact_bonds(bonds, slots, inside, words):
    """As `common_bonds`, of those that are intact."""


@kernel
def mark_common(bonds, slots, inside, words):
    """Compile `common_bonds`."""
    common_bonds(bonds, slots, inside, words)


@kernel
def mark_intact(bonds, slots, inside, common, words):
    """Store the bits of the common bonds that are intact in words (n, n_words)."""
    intact_bonds(bonds, slots, inside, words)
    for n in range(len(slots)):
        for w in range(words.shape[1]):
            words[n, w] &= common[n, w]


@implements(common_bonds, LatticeArrays)
def _common_of_lattice(bonds, slots, inside, words):
    """The stencil numbers a bond alike in both copies."""
    for n in range(len(slots)):
        for k in range(len(bonds.offset)):
            if inside[slots[n] + bonds.offset[k]]:
                words[n, k >> 6] |= np.uint64(1) << np.uint64(k & 63)


@implements(intact_bonds, LatticeArrays)
def _intact_of_lattice(bonds, slots, inside, words):
    for n in range(len(slots)):
        for w in range(words.shape[1]):
            words[n, w] = bonds.alive[w, slots[n]]


@implements(common_bonds, BondArrays)
def _common_of_cloud(bonds, slots, inside, words):
    """Bonds are in ascending id of the neighbours: the n-th one to a particle of the overlap is the same in both copies."""
    for n in range(len(slots)):
        i, bit = slots[n], 0
        for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
            if inside[bonds.neighbour[k]]:
                words[n, bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)
                bit += 1


@implements(intact_bonds, BondArrays)
def _intact_of_cloud(bonds, slots, inside, words):
    for n in range(len(slots)):
        i, bit = slots[n], 0
        for w in range(words.shape[1]):
            words[n, w] = np.uint64(0)
        for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
            if inside[bonds.neighbour[k]]:
                if is_alive(bonds, i, k):
                    words[n, bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)
                bit += 1


def bond_of_bit(bonds, i, inside, bit):
    """Return the bond k of particle i that has the given bit."""


@implements(bond_of_bit, LatticeArrays)
def _bond_of_bit_of_lattice(bonds, i, inside, bit):
    return bit


@implements(bond_of_bit, BondArrays)
def _bond_of_bit_of_cloud(bonds, i, inside, bit):
    seen = -1
    for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
        if inside[bonds.neighbour[k]]:
            seen += 1
            if seen == bit:
                return k
    return -1


@sweep
def break_bits(bonds, shares, points, law, state, linear, third, slots, inside, here, there, force_density, dissipated):
    """Break the bonds whose bit is set in `here` (n, n_words) and not in `there`, and take their forces out of force_density; return how many.

    The force density of particle i loses share pull V_j d / (mass share), dissipated[i], J, gains its part of the bond's energy at the
    critical stretch, at which that breaks in the other copy.
    """
    broken = 0
    for n in range(len(slots)):
        for w in range(here.shape[1]):
            gone = here[n, w] & ~there[n, w]
            if gone == np.uint64(0):
                continue
            for b in range(64):
                if (gone >> np.uint64(b)) & np.uint64(1) == np.uint64(0):
                    continue
                i = slots[n]
                k = bond_of_bit(bonds, i, inside, 64 * w + b)
                j = neighbour(bonds, i, k)
                near, inv_l = near_end(law, points, state, i, j), inverse_length(bonds, i, k)
                _, stretch, shrink, dx, dy, dz = bond_strain(bonds, points, i, j, k, linear, third)
                c, p = moduli(law, near, far_end(law, state, j))
                part = share(shares, i, k) * points.volume[j]
                tension = bond_weight(law, law.weighting, inv_l) * (c * stretch + p * shrink) * part * over_mass(shares, i)
                force_density[i, 0] -= tension * dx
                force_density[i, 1] -= tension * dy
                if third is not None:
                    force_density[i, 2] -= tension * dz
                at = law.critical_stretch[points.block[i], points.block[j]]
                dissipated[i] += points.volume[i] * bond_energy(law, near, moment_weight(law, law.weighting, inv_l) * part, at)
                break_bond(bonds, i, k)
                broken += 1
    return broken


@kernel
def largest_elongation(bonds, slots, displacement, has):
    """Return the largest |u_j - u_i|, m, over the intact bonds of the particles in `slots` to particles that `has` (n_slots,) bool a row in displacement."""
    most = 0.0
    for n in range(len(slots)):
        i = slots[n]
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k) and has[neighbour(bonds, i, k)]:
                square = 0.0
                for d in range(displacement.shape[1]):
                    square += (displacement[neighbour(bonds, i, k), d] - displacement[i, d]) ** 2
                most = max(most, square)
    return np.sqrt(most)
