"""Sweeps over the stiffness of the bonds as they are: blocks of its diagonal, and how near bonds are to breaking. None breaks here."""
from pdhpc.jit import sweep
from pdhpc.kernels import cloud, lattice, shared  # noqa: F401  (they fill the functions of family.py in)
from pdhpc.kernels.family import bond_strain, end_of_bonds, first_bond, inverse_length, is_alive, neighbour, reference_vector, share, stretch_of
from pdhpc.materials.law import bond_weight, far_end, moduli, near_end, stiffness, weighting_between


@sweep
def stiffness_blocks(bonds, points, law, state, third, slots, bounded, result):
    """Store A_i = sum_j C weight V_j e (x) e over intact bonds, N/m^5, of `slots` (n,) in result (n, dim, dim): V_i A_i is i's block of the stiffness of the bonds.

    e : along the bond as it lay in the unloaded body. bounded : replace C by the law's `stiffness`, so that the sum of 2 V_i u_i . A_i u_i bounds u . K u.
    """
    dim = result.shape[1]
    for n in range(len(slots)):
        i = slots[n]
        result[n] = 0.0
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                along, inv_l = reference_vector(bonds, points, i, j, k, third), inverse_length(bonds, i, k)
                c, _ = moduli(law, near_end(law, points, state, i, j), far_end(law, state, j))
                c = stiffness(law, points.block[i], c) if bounded else c
                weight = bond_weight(law, weighting_between(law.weighting, points.block[i], points.block[j]), inv_l) * share(bonds, i, k)
                part = c * weight * points.volume[j] * inv_l * inv_l
                for b in range(dim):
                    for a in range(dim):
                        result[n, a, b] += part * along[a] * along[b]


@sweep
def largest_stretch(bonds, points, law, linear, third, slots):
    """Return the largest s/s0 of the intact bonds of `slots` (n,): above 1 where a bond is to break; 0 without bonds that may.

    Of bonds that break by a critical stretch of their blocks (materials/failure.py: StretchLimit).
    """
    largest = 0.0
    for n in range(len(slots)):
        i = slots[n]
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                measure, _, _, _, _, _ = bond_strain(bonds, points, i, j, k, linear, third)
                largest = max(largest, stretch_of(measure, linear) / law.critical_stretch[points.block[i], points.block[j]])
    return largest
