"""Sweeps over the bonds of a rank's particles, written once for every law, storage of bonds, dimension and kinematics.

Forces, with V_j the neighbour's volume (Silling & Askari 2005; Silling et al. 2007):  f_i = sum_j pull_ij V_j d_ij, see materials/law.py.
"""
from pdhpc.jit import sweep
from pdhpc.kernels import cloud, lattice, reference, shared  # noqa: F401  (they fill the functions of family.py in)
from pdhpc.kernels.family import (
    bond_strain, dilatation_row, end_of_bonds, energy_row, first_bond, force_row, frequency_row, inverse_length, is_alive, neighbour, place,
    raised_row, reference_vector, row_width, share,
)
from pdhpc.kernels.reference import break_row
from pdhpc.kernels.simd import chosen
from pdhpc.materials.law import bond_weight, far_end, moment_weight, near_end, pull, weighting_between


@sweep
def bond_forces(bonds, points, law, state, linear, third, rows, force_density, dissipated):
    """Compute internal force densities and break bonds beyond their limit; a bond that breaks exerts no force in the same evaluation.

    Parameters
    ----------
    bonds : BondArrays, LatticeArrays or SharedBonds. points : PointArrays. law : a law of materials/.
    state : None, or (n_slots, 2) of state-based laws: a_i and p_i, of ghosts too.
    linear : True, or None in finite kinematics. third : None in 2D, 2 in 3D (types, so that each case compiles on its own).
    rows : int32, first slots of the particles (cloud) or blocks of eight (lattice) to do.
    force_density : (n_slots, dim), N/m^3, overwritten in these rows.
    dissipated : (n_slots,), J, gains what each particle loses of its energy (the other end's owner adds its half of each bond).

    Returns
    -------
    int, directed bonds broken in this evaluation.
    """
    broken = 0
    t, beyond = _sum_forces(0, bonds, points, law, state, linear, third, rows, force_density)
    while beyond:  # a row that lost bonds is summed again by the same loop: forces depend on the state alone, not on how it came about
        newly_broken = _break(rows[t], bonds, points, law, state, linear, third, dissipated)
        broken += newly_broken
        t, beyond = _sum_forces(t if newly_broken else t + 1, bonds, points, law, state, linear, third, rows, force_density)
    return broken


@sweep
def dilatations(bonds, points, law, state, linear, third, rows, dissipated):
    """Compute p_i of state-based laws, state[i, 1], from the dilatation of each particle, and break bonds beyond their limit.

    Parameters and result as of bond_forces. The forces that follow find no bond beyond its limit, since they see the same positions.
    """
    broken = 0
    t, beyond = _sum_dilatations(0, bonds, points, law, state, linear, third, rows)
    while beyond:
        newly_broken = _break(rows[t], bonds, points, law, state, linear, third, dissipated)
        broken += newly_broken
        t, beyond = _sum_dilatations(t if newly_broken else t + 1, bonds, points, law, state, linear, third, rows)
    return broken


@sweep
def smallest_stretches(bonds, points, law, state, linear, third, rows, dissipated):
    """Compute raised_i = -alpha min(0, min_j s_ij), of points, over intact bonds: by how much compression raises the critical stretch of each particle.

    Parameters as of bond_forces; law.failure: SoftenedLimit. Bonds that break are stretched, so that it does not matter whether they count.

    Returns
    -------
    int, 0: no bond breaks here.
    """
    for t in range(len(rows)):
        raised_row(bonds, rows[t], points, law.failure.softening, linear, third)
    return 0


if chosen() == "reference":
    bond_forces, dilatations, smallest_stretches = reference.bond_forces, reference.dilatations, reference.smallest_stretches


@sweep
def _sum_forces(first, bonds, points, law, state, linear, third, rows, force_density):
    """Sum forces from row `first` on, up to the first with a bond beyond its limit; return (it or the number of rows, whether there is one).

    Calls inlined functions only: around any other call numba counts references to every array, in each row, which costs a third of the speed.
    """
    for t in range(first, len(rows)):
        if force_row(bonds, rows[t], points, law, state, linear, third, force_density):
            return t, True
    return len(rows), False


@sweep
def _sum_dilatations(first, bonds, points, law, state, linear, third, rows):
    """As _sum_forces, of dilatations."""
    for t in range(first, len(rows)):
        if dilatation_row(bonds, rows[t], points, law, state, linear, third):
            return t, True
    return len(rows), False


@sweep
def _break(first, bonds, points, law, state, linear, third, dissipated):
    """Break the bonds beyond their limit of the particles that one row takes; return how many."""
    broken = 0
    for i in range(first, first + row_width(bonds)):
        broken += break_row(bonds, i, points, law, state, linear, third, dissipated)
    return broken


@sweep
def strain_energy_density(bonds, points, law, state, linear, third, rows, energy):
    """Store W_i, J/m^3, of the particles in `rows` (as of bond_forces) in energy (n_slots,): i's part of its bonds' energies, and what its dilatation adds."""
    for t in range(len(rows)):
        energy_row(bonds, rows[t], points, law, state, linear, third, energy)


@sweep
def stress(bonds, points, law, state, linear, third, slots, result):
    """Store the stress sigma_i = 1/2 sum_j f_ij (x) xi_ij V_j, Pa, of the particles in `slots` (n,) in result (n, dim, dim).

    f_ij is the pair force vector and xi_ij the reference bond: the first Piola-Kirchhoff stress (the Cauchy stress in linear kinematics) of a homogeneous
    deformation (Lehoucq & Silling 2008); within a horizon of a free surface the sum lacks neighbours.
    """
    dim = result.shape[1]
    for n in range(len(slots)):
        i = slots[n]
        result[n] = 0.0
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                measure, stretch, shrink, dx, dy, dz = bond_strain(bonds, points, i, j, k, linear, third)
                weighting = weighting_between(law.weighting, points.block[i], points.block[j])
                weight = bond_weight(law, weighting, inverse_length(bonds, i, k)) * share(bonds, i, k)
                tension = 0.5 * pull(law, near_end(law, points, state, i, j), far_end(law, state, j), weight, stretch, shrink) * points.volume[j]
                along, xi = (dx, dy, dz), reference_vector(bonds, points, i, j, k, third)
                for b in range(dim):
                    for a in range(dim):
                        result[n, a, b] += tension * along[a] * xi[b]


@sweep
def deformation_moments(bonds, points, law, third, slots, shape, moment):
    """Store K_i = sum_j w xi (x) xi V_j in shape and N_i = sum_j w p (x) xi V_j in moment, both (n, dim, dim), over intact bonds of `slots` (n,).

    p = position_j - position_i; w = weight |xi|. N K^-1 is the nonlocal deformation gradient (finite) or displacement gradient (linear) (Silling et al. 2007).
    """
    dim = shape.shape[1]
    for n in range(len(slots)):
        i = slots[n]
        shape[n] = 0.0
        moment[n] = 0.0
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j, inv_l = neighbour(bonds, i, k), inverse_length(bonds, i, k)
                weighting = weighting_between(law.weighting, points.block[i], points.block[j])
                weight = bond_weight(law, weighting, inv_l) * share(bonds, i, k) * points.volume[j] / inv_l
                xi = reference_vector(bonds, points, i, j, k, third)
                for b in range(dim):
                    for a in range(dim):
                        shape[n, a, b] += weight * xi[a] * xi[b]
                        moment[n, a, b] += weight * (points.position[j, a] - points.position[i, a]) * xi[b]


@sweep
def largest_frequency2(bonds, points, law, state, third, rows):
    """Return max_i |A_i| / rho_i, 1/s^2, over `rows` (as of bond_forces), with A_i = sum_j C weight V_j e (x) e over intact bonds, C the law's stiffness."""
    largest = 0.0
    for t in range(len(rows)):
        largest = max(largest, frequency_row(bonds, rows[t], points, law, state, third))
    return largest


@sweep
def weighted_volumes(bonds, points, law, slots, state):
    """Store a_i = deviatoric / m_i in state[i, 0] of `slots`, m_i = sum_j weight |xi|^2 V_j over intact bonds, m^5; 0 for a particle without bonds."""
    for n in range(len(slots)):
        i, m = slots[n], 0.0
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                weighting = weighting_between(law.weighting, points.block[i], points.block[j])
                m += moment_weight(law, weighting, inverse_length(bonds, i, k)) * points.volume[j]
        state[i, 0] = law.deviatoric[points.block[i]] / m if m > 0.0 else 0.0


@sweep
def places(bonds, points, slots, result):
    """Store the reference positions, m, of the particles in `slots` (n,) in result (n, dim)."""
    for n in range(len(slots)):
        at = place(bonds, points, slots[n])
        for d in range(result.shape[1]):
            result[n, d] = at[d]
