"""Forces bond by bond: the readable twin of the vector loop of cloud.py, which also serves rows of several blocks or volumes.

`bond_forces` here and there agree to rounding. It takes over where the vector unit is too old, or with PDHPC_KERNELS=reference (see kernels/cloud.py).
"""
import numpy as np

from pdhpc.jit import inlined, kernel
from pdhpc.kernels.simd import fma
from pdhpc.materials.bond_based import bond_weight, pair_energy, pair_force


@kernel
def bond_forces(points, bonds, law, linear, third, rows, force_density, dissipated):
    """Compute internal force densities and break bonds, as cloud.bond_forces, whose parameters and result these are. Local."""
    broken = 0
    for i in range(rows[0], rows[1]):
        if row_force(i, points, bonds, law, linear, third, force_density):
            broken += break_row(i, points, bonds, law, linear, third, dissipated)
            row_force(i, points, bonds, law, linear, third, force_density)
    return broken


@inlined
def row_force(i, points, bonds, law, linear, third, force_density):
    """Store f_i = sum_j c omega beta s V_j e_ij, N/m^3, the sum in the order of the slots; return whether an alive bond exceeds its critical stretch."""
    block = points.block[i]
    fx, fy, fz, beyond = 0.0, 0.0, 0.0, False
    for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
        if not is_alive(bonds.alive, k):
            continue
        j = bonds.neighbour[k]
        stretch, along, ex, ey, ez = bond_stretch(i, k, points, bonds, linear, third)
        pull = pair_force(law.micromodulus[block, points.block[j]], bond_weight(bonds.inv_length[k], law), stretch) * along * points.volume[j]
        beyond |= stretch > law.critical_stretch[block, points.block[j]]
        fx += pull * ex
        fy += pull * ey
        fz += pull * ez
    force_density[i, 0] = fx
    force_density[i, 1] = fy
    if third is not None:
        force_density[i, 2] = fz
    return beyond


@kernel
def break_row(i, points, bonds, law, linear, third, dissipated):
    """Break the bonds of particle i beyond their critical stretch; return how many.

    A bond dissipates its energy at the critical stretch, which it passed during the step, on average in the middle of it. The work of its force in that step
    is half of what it would have been, so that to first order the two agree and the energy balance closes; its energy at the step's end would be too much.
    """
    broken = 0
    block = points.block[i]
    for k in range(bonds.row_start[i], bonds.row_start[i + 1]):
        if not is_alive(bonds.alive, k):
            continue
        j = bonds.neighbour[k]
        stretch, _, _, _, _ = bond_stretch(i, k, points, bonds, linear, third)
        limit = law.critical_stretch[block, points.block[j]]
        if stretch > limit:
            bonds.alive[k >> 3] &= ~np.uint8(1 << (k & 7))
            inv_l = bonds.inv_length[k]
            energy = pair_energy(law.micromodulus[block, points.block[j]], bond_weight(inv_l, law), limit, inv_l)
            dissipated[i] += 0.5 * energy * points.volume[i] * points.volume[j]
            broken += 1
    return broken


@inlined
def is_alive(alive, k):
    """Return whether the bond in slot k is intact."""
    return (alive[k >> 3] >> np.uint8(k & 7)) & np.uint8(1) != 0


@inlined
def bond_stretch(i, k, points, bonds, linear, third):
    """Return the stretch of bond k of particle i, and the factor and the vector (m) that turn pair_force into a force.

    The same operations in the same order as in the vector loop: both must find the same stretch to the last bit, since a bond breaks at both of its ends or at
    none.
    """
    j = bonds.neighbour[k]
    inv_l = bonds.inv_length[k]
    ex, ey = points.position[j, 0] - points.position[i, 0], points.position[j, 1] - points.position[i, 1]
    dx, dy, ez, dz = ex, ey, 0.0, 0.0
    if linear:
        dx, dy = points.reference[j, 0] - points.reference[i, 0], points.reference[j, 1] - points.reference[i, 1]
    along2 = dy * ey
    if third is not None:
        ez = points.position[j, 2] - points.position[i, 2]
        dz = points.reference[j, 2] - points.reference[i, 2] if linear else ez
        along2 = fma(dy, ey, dz * ez)
    along2 = fma(dx, ex, along2)
    if linear:
        return along2 * (inv_l * inv_l), 1.0, dx, dy, dz
    ratio = np.sqrt(along2 * (inv_l * inv_l))
    return ratio - 1.0, 1.0 / ratio, dx, dy, dz
