"""Surface corrections of a cloud: what families lack, and the factors of bonds that make up for it; over all bonds of the intact body, before any crack."""
import numpy as np

from pdhpc.jit import sweep
from pdhpc.kernels.family import end_of_bonds, first_bond, inverse_length, is_alive, neighbour, reference_vector, share
from pdhpc.materials.law import influence_over_length, weighting_between


@sweep
def directional_energies(bonds, points, law, own, third, slots, energy):
    """Store W_i,d = 1/4 sum_j lambda c omega beta n_d^4 r V_j, J/m^3, of the particles in `slots` (n,) under a unit extension along each axis in energy (n, dim).

    lambda is the factor that the bonds have, 1 without any; n = xi/|xi|, so that the (linear) stretch of a bond is n_d^2. own (n_block, n_block): the micromodulus c of the first block's material alone, at the horizon
    of bonds between both blocks: where materials meet no surface is seen.
    """
    for n in range(len(slots)):
        i = slots[n]
        energy[n] = 0.0
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j, inv_l = neighbour(bonds, i, k), inverse_length(bonds, i, k)
                weighting = weighting_between(law.weighting, points.block[i], points.block[j])
                part = 0.25 * own[points.block[i], points.block[j]] * influence_over_length(weighting, inv_l) / (inv_l * inv_l) * points.volume[j]
                part *= share(bonds, i, k)
                xi = reference_vector(bonds, points, i, j, k, third)
                for d in range(energy.shape[1]):
                    n2 = (xi[d] * inv_l) * (xi[d] * inv_l)
                    energy[n, d] += part * n2 * n2


@sweep
def family_shares(bonds, points, law, whole, slots, share):
    """Store v_i = V_i/V0(i, i) + sum_j beta V_j/V0(i, j), the share of its whole family that each particle of `slots` (n,) has, in share (n, 1).

    whole (n_block, n_block), m^3: V0, the volume within the horizon of bonds between both blocks.
    """
    for n in range(len(slots)):
        i = slots[n]
        total = points.volume[i] / whole[points.block[i], points.block[i]]
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                weighting = weighting_between(law.weighting, points.block[i], points.block[j])
                beta = min(1.0, (weighting.ramp_end - 1.0 / inverse_length(bonds, i, k)) * weighting.ramp_slope)
                total += beta * points.volume[j] / whole[points.block[i], points.block[j]]
        share[n, 0] = total


@sweep
def energy_factors(bonds, points, third, slots, scale, factor):
    """Store in factor (n_bond_slots,) of the bonds of `slots` (n,): (sum_d (n_d/s_d)^2)^(-1/2), s_d = (scale_i,d + scale_j,d)/2.

    scale (n_slots, dim), of ghosts too: W_d of the bulk over W_i,d (Madenci & Oterkus 2014).
    """
    for n in range(len(slots)):
        i = slots[n]
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            j, inv_l = neighbour(bonds, i, k), inverse_length(bonds, i, k)
            xi = reference_vector(bonds, points, i, j, k, third)
            total = 0.0
            for d in range(scale.shape[1]):
                along = xi[d] * inv_l / (0.5 * (scale[i, d] + scale[j, d]))
                total += along * along
            factor[k] = 1.0 / np.sqrt(total) if is_alive(bonds, i, k) else 1.0


@sweep
def volume_factors(bonds, slots, share, factor):
    """Store in factor (n_bond_slots,) of the bonds of `slots` (n,): 2 V0/(V_i + V_j) = 2/(v_i + v_j); share (n_slots, 1), of ghosts too: v."""
    for n in range(len(slots)):
        i = slots[n]
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            factor[k] = 2.0 / (share[i, 0] + share[neighbour(bonds, i, k), 0]) if is_alive(bonds, i, k) else 1.0
