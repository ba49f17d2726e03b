"""What a sweep asks about the bonds of a particle, whichever way they are stored: each storage fills these functions in (pdhpc.jit.implements).

Storages: BondArrays (cloud.py, compressed rows), LatticeArrays (lattice.py, a stencil and bits), CloudShares and LatticeShares (shared.py, weighted bonds of
marked particles).
Particles are named by their slot i, a row of the arrays of `PointArrays`; k counts bonds from first_bond(bonds, i) to end_of_bonds(bonds, i) - 1, the same
bonds in the same order on any rank.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import inlined
from pdhpc.kernels.simd import fma

MIXED = 255
"""Mark of a row whose neighbours differ in block; other rows carry their block. No block has this number, nor a slot without a particle another."""

VARIED = 254
"""Mark of a row of a cloud whose neighbours are of its block, but differ in volume. No block has this number."""


class PointArrays(NamedTuple):
    """Particles as kernels see them, by slot: owned, ghosts and, in a lattice, cells without a particle.

    reference (n, width), m (of a cloud; empty in a lattice); position (n, width), m: current positions (finite kinematics) or displacements (linear); width 2
    in 2D; in 3D 4 in a cloud, so that a row is one load, and 3 in a lattice, where each component lies together;
    volume (n,), m^3; block (n,) uint8; row_block (n_owned,) uint8, of a cloud: the block of the whole row, MIXED or VARIED;
    raised (n,): by how much compression raises the critical stretch of a particle, of materials that soften so (materials/failure.py), else empty;
    strength (n_slots,): factors of the critical stretch of particles of materials that scatter (kernels/strength.py), 1 where no particle is, else empty.
    """

    reference: np.ndarray
    position: np.ndarray
    volume: np.ndarray
    block: np.ndarray
    row_block: np.ndarray
    raised: np.ndarray = np.empty(0)
    strength: np.ndarray = np.empty(0)


def first_bond(bonds, i):
    """Return the first k of particle i."""


def end_of_bonds(bonds, i):
    """Return one past the last k of particle i."""


def neighbour(bonds, i, k):
    """Return the slot of the other end; any valid slot for a bond that is not alive."""


def is_alive(bonds, i, k):
    """Return whether the bond is intact."""


def break_bond(bonds, i, k):
    """Make the bond broken."""


def count_alive(bonds, i):
    """Return the number of intact bonds of particle i."""


def inverse_length(bonds, i, k):
    """Return 1/|xi|, 1/m."""


def reference_vector(bonds, points, i, j, k, third):
    """Return (x, y, z) of xi = X_j - X_i, m; z = 0 in 2D."""


def place(bonds, points, i):
    """Return (x, y, z) of X_i, m, the same bits for a particle whoever asks; z = 0 in 2D."""


def share(bonds, i, k):
    """Return the weight of the bond: 1 unless its particle is marked (kernels/shared.py)."""


def over_mass(bonds, i):
    """Return one over the share of the particle's mass that is here: 1 unless it is marked."""


def over_energy(bonds, i):
    """Return one over the share of the particle's energy that is here, 0 where none is: 1 unless it is marked."""


def force_row(bonds, i, points, law, state, linear, third, force_density):
    """Sum the forces on the particle, or on the eight particles, from slot i on; return whether an alive bond exceeds its limit."""


def dilatation_row(bonds, i, points, law, state, linear, third):
    """Set p (state[:, 1]) of the particle, or of the eight particles, from slot i on; return whether an alive bond exceeds its limit."""


def energy_row(bonds, i, points, law, state, linear, third, energy):
    """Store the energy density of the particle, or of the eight particles, from slot i on; see sweeps.strain_energy_density."""


def frequency_row(bonds, i, points, law, state, third):
    """Return |A|/rho, 1/s^2, of the particle, the largest of the eight particles, from slot i on; see sweeps.largest_frequency2."""


def raised_row(bonds, i, points, softening, linear, third):
    """Set points.raised of the particle, or of the eight particles, from slot i on; see sweeps.smallest_stretches."""


def row_width(bonds):
    """Return the number of particles that force_row and dilatation_row take at once."""


@inlined
def bond_strain(bonds, points, i, j, k, linear, third):
    """Return (measure, stretch, shrink, dx, dy, dz) of a bond: see materials/law.py; d is the vector it pulls along, m.

    The same operations in the same order as in the vector loops: all must find the same measure to the last bit, since a bond breaks at both of its ends or at
    none.
    """
    inv_l = inverse_length(bonds, i, k)
    ex, ey = points.position[j, 0] - points.position[i, 0], points.position[j, 1] - points.position[i, 1]
    ez = 0.0 if third is None else points.position[j, 2] - points.position[i, 2]
    dx, dy, dz = ex, ey, ez
    if linear is not None:
        dx, dy, dz = reference_vector(bonds, points, i, j, k, third)
    along2 = fma(dx, ex, dy * ey) if third is None else fma(dx, ex, fma(dy, ey, dz * ez))
    measure = along2 * (inv_l * inv_l)
    if linear is not None:
        return measure, measure, 1.0, dx, dy, dz
    shrink = 1.0 / np.sqrt(measure)
    return measure, 1.0 - shrink, shrink, dx, dy, dz


@inlined
def raise_of(points, i, softening, least, linear):
    """Return -alpha min(0, s_min) of particle i, `least` the smallest measure of its bonds and of an unstretched one; 0 in a cell without a particle."""
    block = points.block[i]
    return softening[block] * (0.0 - stretch_of(least, linear)) if block < len(softening) else 0.0


@inlined
def stretch_of(measure, linear):
    """Return s of a bond from its measure."""
    return measure if linear is not None else np.sqrt(measure) - 1.0
