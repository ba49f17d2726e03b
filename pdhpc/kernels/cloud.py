"""Sweeps over the bonds of a general cloud of particles (compressed rows, full list: each particle sums all of its own bonds).

Each row is summed by one thread of control over slots sorted by global id, so a particle's force has the same bits on any rank that owns it.
Forces, with V_j the neighbour's volume, c, omega, beta of materials/bond_based.py and xi = X_j - X_i, eta = u_j - u_i (Silling & Askari 2005):

    finite:  s = |xi + eta|/|xi| - 1,         f_i = sum_j c omega beta s V_j (xi + eta)/|xi + eta|
    linear:  s = xi . eta / |xi|^2,           f_i = sum_j c omega beta s V_j xi/|xi|

Rows of one block and one volume go eight bonds at a time (kernels/simd.py), MIXED rows bond by bond (kernels/reference.py). PDHPC_KERNELS=reference, or a
processor without AVX2, sends all rows bond by bond.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import inlined, kernel
from pdhpc.kernels import reference
from pdhpc.kernels.reference import bond_stretch, break_row, is_alive, row_force
from pdhpc.kernels.simd import LANES, any_of, chosen, fma, gather_xy, gather_xyz, lane_mask, lane_sum, larger, load8, select, splat, sqrt8
from pdhpc.materials.bond_based import bond_weight, pair_energy, pair_force

MIXED = 255
"""Mark of a row whose neighbours differ in block or volume; other rows carry their block."""


class PointArrays(NamedTuple):
    """Particles as kernels see them: owned first, then ghosts.

    reference (n, width), m; position (n, width), m: current positions (finite kinematics) or displacements (linear); width 2 in 2D and 4 in 3D, padded
    so that a row is one load;
    volume (n,), m^3; block (n,) uint8; row_block (n_owned,) uint8: the block of the whole row, or MIXED.
    """

    reference: np.ndarray
    position: np.ndarray
    volume: np.ndarray
    block: np.ndarray
    row_block: np.ndarray


@kernel
def bond_forces(points, bonds, law, linear, third, rows, force_density, dissipated):
    """Compute internal force densities and break bonds stretched beyond their limit; a bond that breaks exerts no force in the same evaluation.

    Parameters
    ----------
    points, bonds, law : PointArrays, BondArrays, Law.
    linear : bool, kinematics. third : None in 2D, 2 in 3D (a type, so that each dimension compiles on its own).
    rows : (first, last) owned particles to do.
    force_density : (n_owned, dim), N/m^3, overwritten in `rows`.
    dissipated : (n_owned,), J, gains half of the energy at critical stretch of each bond that breaks (the other end's owner adds the other half).

    Returns
    -------
    int, directed bonds broken in this evaluation.
    """
    broken = 0
    i, beyond = _sum_rows(rows[0], rows[1], points, bonds, law, linear, third, force_density)
    while beyond:  # a row that lost bonds is summed again by the same loop: forces depend on the state alone, not on how it came about
        newly_broken = break_row(i, points, bonds, law, linear, third, dissipated)
        broken += newly_broken
        i, beyond = _sum_rows(i if newly_broken else i + 1, rows[1], points, bonds, law, linear, third, force_density)
    return broken


if not chosen():
    bond_forces = reference.bond_forces


@kernel
def _sum_rows(first, last, points, bonds, law, linear, third, force_density):
    """Sum the forces on particles from `first` on, up to the first with a bond beyond its critical stretch; return (it or last, whether there is one).

    Calls inlined functions only: around any other call numba counts references to every array, in each row, which costs a third of the speed.
    """
    for i in range(first, last):
        block = points.row_block[i]
        if block == MIXED:
            beyond = row_force(i, points, bonds, law, linear, third, force_density)
        else:
            c, limit = law.micromodulus[block, block], law.critical_stretch[block, block]
            beyond = _row_force(i, c, limit, points, bonds, law, linear, third, force_density)
        if beyond:
            return i, True
    return last, False


@inlined
def _row_force(i, c, limit, points, bonds, law, linear, third, force_density):
    """Sum the forces on particle i, whose bonds share c (N/m^6) and limit, eight bonds at a time; return whether an alive bond exceeds the limit."""
    fx, fy, fz, largest = splat(0.0), splat(0.0), splat(0.0), splat(-1.0)
    for k in range(bonds.row_start[i], bonds.row_start[i + 1], LANES):
        inv_l = load8(bonds.inv_length, k)
        live = lane_mask(bonds.alive[k >> 3])
        if third is None:
            ex, ey = _offsets_2d(points.position, bonds.neighbour, i, k)
            dx, dy = _offsets_2d(points.reference, bonds.neighbour, i, k) if linear else (ex, ey)
            along2, length2 = fma(dx, ex, dy * ey), inv_l * inv_l
        else:
            ex, ey, ez = _offsets_3d(points.position, bonds.neighbour, i, k)
            dx, dy, dz = _offsets_3d(points.reference, bonds.neighbour, i, k) if linear else (ex, ey, ez)
            along2, length2 = fma(dx, ex, fma(dy, ey, dz * ez)), inv_l * inv_l
        if linear:  # s = xi . eta / |xi|^2, along xi/|xi|
            stretch = along2 * length2
            pull = pair_force(c, bond_weight(inv_l, law), stretch)
        else:  # s = |xi + eta|/|xi| - 1, along (xi + eta)/|xi + eta|
            ratio = sqrt8(along2 * length2)
            stretch = ratio - 1.0
            pull = pair_force(c, bond_weight(inv_l, law), stretch) / ratio
        largest = select(live, larger(stretch, largest), largest)
        fx, fy = select(live, fma(pull, dx, fx), fx), select(live, fma(pull, dy, fy), fy)
        if third is not None:
            fz = select(live, fma(pull, dz, fz), fz)
    volume = points.volume[i]
    force_density[i, 0] = lane_sum(fx) * volume
    force_density[i, 1] = lane_sum(fy) * volume
    if third is not None:
        force_density[i, 2] = lane_sum(fz) * volume
    return any_of(largest > limit)


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


@kernel
def strain_energy_density(points, bonds, law, linear, third, energy):
    """Store W_i = 1/2 sum_j w_ij V_j, J/m^3, in energy (n_owned,); w the micropotential of intact bonds."""
    for i in range(len(energy)):
        block, total = points.block[i], 0.0
        for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
            if is_alive(bonds.alive, k):
                j = bonds.neighbour[k]
                stretch, _, _, _, _ = bond_stretch(i, k, points, bonds, linear, third)
                inv_l = bonds.inv_length[k]
                weight = bond_weight(inv_l, law)
                total += pair_energy(law.micromodulus[block, points.block[j]], weight, stretch, inv_l) * points.volume[j]
        energy[i] = 0.5 * total


@kernel
def stress(points, bonds, law, linear, third, result):
    """Store the stress sigma_i = 1/2 sum_j t_ij (x) xi_ij V_j, Pa, in result (n_owned, dim, dim).

    t_ij is the pair force vector and xi_ij the reference bond: the first Piola-Kirchhoff stress (the Cauchy stress in linear kinematics) of a homogeneous
    deformation (Lehoucq & Silling 2008); within a horizon of a free surface the sum lacks neighbours.
    """
    dim = result.shape[1]
    for i in range(len(result)):
        block = points.block[i]
        result[i] = 0.0
        for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
            if is_alive(bonds.alive, k):
                j = bonds.neighbour[k]
                s, along, ex, ey, ez = bond_stretch(i, k, points, bonds, linear, third)
                weight = bond_weight(bonds.inv_length[k], law)
                pull = 0.5 * pair_force(law.micromodulus[block, points.block[j]], weight, s) * along * points.volume[j]
                vector = (ex, ey, ez)
                for b in range(dim):
                    xi = points.reference[j, b] - points.reference[i, b]
                    for a in range(dim):
                        result[i, a, b] += pull * vector[a] * xi


@kernel
def deformation_moments(points, bonds, law, shape, moment):
    """Store K_i = sum_j w xi (x) xi V_j in shape and N_i = sum_j w p (x) xi V_j in moment, both (n_owned, dim, dim), over intact bonds.

    p = position_j - position_i; w = omega beta. N K^-1 is the nonlocal deformation gradient (finite) or displacement gradient (linear) (Silling et al. 2007).
    """
    dim = shape.shape[1]
    for i in range(len(shape)):
        shape[i] = 0.0
        moment[i] = 0.0
        for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
            if is_alive(bonds.alive, k):
                j = bonds.neighbour[k]
                weight = bond_weight(bonds.inv_length[k], law) * points.volume[j] / bonds.inv_length[k]
                for b in range(dim):
                    xi = points.reference[j, b] - points.reference[i, b]
                    for a in range(dim):
                        shape[i, a, b] += weight * (points.reference[j, a] - points.reference[i, a]) * xi
                        moment[i, a, b] += weight * (points.position[j, a] - points.position[i, a]) * xi


@kernel
def largest_frequency2(points, bonds, law):
    """Return max_i |A_i| / rho_i, 1/s^2, with A_i = sum_j c omega beta V_j / |xi| e (x) e over intact bonds and |.| its largest absolute row sum."""
    dim = 2 if points.reference.shape[1] == 2 else 3
    largest = 0.0
    tensor = np.empty((dim, dim))
    for i in range(len(points.row_block)):
        block = points.block[i]
        tensor[:] = 0.0
        for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
            if is_alive(bonds.alive, k):
                j = bonds.neighbour[k]
                inv_l = bonds.inv_length[k]
                stiffness = pair_force(law.micromodulus[block, points.block[j]], bond_weight(inv_l, law), 1.0) * points.volume[j] * inv_l * inv_l
                for a in range(dim):
                    for b in range(dim):
                        tensor[a, b] += stiffness * (points.reference[j, a] - points.reference[i, a]) * (points.reference[j, b] - points.reference[i, b])
        for a in range(dim):
            row_sum = 0.0
            for b in range(dim):
                row_sum += abs(tensor[a, b])
            largest = max(largest, row_sum / law.density[block])
    return largest
