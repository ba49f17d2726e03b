"""Forces bond by bond: the readable twin of the vector loops of cloud.py and lattice.py, on either storage.

It agrees with them to rounding, takes over where the vector unit is too old or with PDHPC_KERNELS=reference, and serves what vectors do not: rows of
several blocks or volumes, the bonds of marked particles, and the bonds that break.
"""
from pdhpc.jit import inlined, sweep
from pdhpc.kernels.failure import fails, fails_by_strain, released_stretch
from pdhpc.kernels.family import (
    bond_strain, break_bond, end_of_bonds, first_bond, inverse_length, is_alive, neighbour, over_energy, over_mass, raise_of, reference_vector, row_width,
    share, stretch_of,
)
from pdhpc.materials.law import (
    bond_energy, bond_weight, far_end, moduli, moment_weight, near_end, pull, spherical_part, stiffness, volume_energy, weighting_between,
)


@sweep
def bond_forces(bonds, points, law, state, linear, third, rows, force_density, dissipated):
    """Compute internal force densities and break bonds, as sweeps.bond_forces, whose parameters and result these are. Local."""
    broken = 0
    for t in range(len(rows)):
        for i in range(rows[t], rows[t] + row_width(bonds)):
            if force_on(bonds, i, points, law, state, linear, third, force_density):
                broken += break_row(bonds, i, points, law, state, linear, third, dissipated)
                force_on(bonds, i, points, law, state, linear, third, force_density)
    return broken


@sweep
def dilatations(bonds, points, law, state, linear, third, rows, dissipated):
    """Compute p of state-based laws and break bonds, as sweeps.dilatations, whose parameters and result these are. Local."""
    broken = 0
    for t in range(len(rows)):
        for i in range(rows[t], rows[t] + row_width(bonds)):
            if dilatation_of(bonds, i, points, law, state, linear, third):
                broken += break_row(bonds, i, points, law, state, linear, third, dissipated)
                dilatation_of(bonds, i, points, law, state, linear, third)
    return broken


@sweep
def smallest_stretches(bonds, points, law, state, linear, third, rows, dissipated):
    """Compute by how much compression raises critical stretches, as sweeps.smallest_stretches, whose parameters and result these are. Local."""
    for t in range(len(rows)):
        for i in range(rows[t], rows[t] + row_width(bonds)):
            least = 0.0 if linear is not None else 1.0
            for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
                if is_alive(bonds, i, k):
                    measure, _, _, _, _, _ = bond_strain(bonds, points, i, neighbour(bonds, i, k), k, linear, third)
                    least = min(least, measure)
            points.raised[i] = raise_of(points, i, law.failure.softening, least, linear)
    return 0


@inlined
def force_on(bonds, i, points, law, state, linear, third, force_density):
    """Store f_i = sum_j pull_ij V_j d_ij, N/m^3, the sum in the order of the bonds; return whether an alive bond exceeds its limit."""
    fx, fy, fz, beyond = 0.0, 0.0, 0.0, False
    for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
        if not is_alive(bonds, i, k):
            continue
        j = neighbour(bonds, i, k)
        measure, stretch, shrink, dx, dy, dz = bond_strain(bonds, points, i, j, k, linear, third)
        inv_l, weighting = inverse_length(bonds, i, k), weighting_between(law.weighting, points.block[i], points.block[j])
        weight = bond_weight(law, weighting, inv_l) * share(bonds, i, k)
        tension = pull(law, near_end(law, points, state, i, j), far_end(law, state, j), weight, stretch, shrink) * points.volume[j]
        beyond |= fails(law.failure, law, points, state, i, j, inv_l, measure, linear)
        fx += tension * dx
        fy += tension * dy
        fz += tension * dz
    over = over_mass(bonds, i)
    force_density[i, 0] = fx * over
    force_density[i, 1] = fy * over
    if third is not None:
        force_density[i, 2] = fz * over
    return beyond


@inlined
def dilatation_of(bonds, i, points, law, state, linear, third):
    """Store p_i = volumetric a_i^2 sum_j weight s |xi|^2 V_j in state (n_slots, 2); return whether an alive bond exceeds its limit."""
    total, beyond = 0.0, False
    for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
        if not is_alive(bonds, i, k):
            continue
        j = neighbour(bonds, i, k)
        measure, _, _, _, _, _ = bond_strain(bonds, points, i, j, k, linear, third)
        inv_l, weighting = inverse_length(bonds, i, k), weighting_between(law.weighting, points.block[i], points.block[j])
        total += moment_weight(law, weighting, inv_l) * share(bonds, i, k) * stretch_of(measure, linear) * points.volume[j]
        beyond |= fails_by_strain(law.failure, law, points, i, j, inv_l, measure, linear)
    block = points.block[i]
    total *= over_energy(bonds, i)
    state[i, 1] = law.volumetric[block] * state[i, 0] * state[i, 0] * total if block < len(law.volumetric) else 0.0
    return beyond


@inlined
def energy_of(bonds, i, points, law, state, linear, third, energy):
    """Store W_i, J/m^3, in energy (n_slots,): i's part of its bonds' energies, and what its dilatation adds."""
    total, extended = 0.0, 0.0
    for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
        if is_alive(bonds, i, k):
            j = neighbour(bonds, i, k)
            measure, _, _, _, _, _ = bond_strain(bonds, points, i, j, k, linear, third)
            weighting = weighting_between(law.weighting, points.block[i], points.block[j])
            moment = moment_weight(law, weighting, inverse_length(bonds, i, k)) * share(bonds, i, k) * points.volume[j]
            s = stretch_of(measure, linear)
            total += bond_energy(law, near_end(law, points, state, i, j), moment, s)
            extended += moment * s
    block = points.block[i]
    if block < len(law.density):
        total += volume_energy(law, near_end(law, points, state, i, i), spherical_part(law, block), extended) * over_energy(bonds, i)
    energy[i] = total


@inlined
def frequency_of(bonds, i, points, law, state, third):
    """Return |A_i|/rho_i, 1/s^2, with |.| the largest absolute row sum; see sweeps.largest_frequency2."""
    xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    block = points.block[i]
    for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
        if not is_alive(bonds, i, k):
            continue
        j, inv_l = neighbour(bonds, i, k), inverse_length(bonds, i, k)
        x, y, z = reference_vector(bonds, points, i, j, k, third)
        c, _ = moduli(law, near_end(law, points, state, i, j), far_end(law, state, j))
        weighting = weighting_between(law.weighting, block, points.block[j])
        part = stiffness(law, block, c) * bond_weight(law, weighting, inv_l) * share(bonds, i, k) * points.volume[j] * inv_l * inv_l
        xx, yy, zz = xx + part * x * x, yy + part * y * y, zz + part * z * z
        xy, xz, yz = xy + part * x * y, xz + part * x * z, yz + part * y * z
    largest = max(xx + abs(xy) + abs(xz), max(yy + abs(xy) + abs(yz), zz + abs(xz) + abs(yz)))
    return largest * over_mass(bonds, i) / law.density[block] if largest > 0.0 else 0.0


@sweep
def break_row(bonds, i, points, law, state, linear, third, dissipated):
    """Break the bonds of particle i beyond their limit; return how many.

    dissipated[i], J, gains V_i times the drop of i's energy density when the bonds that break leave it at their released_stretch, the others as they are: its
    part of the energy of each, and what it holds beside its bonds, volume_energy(left + lost) - volume_energy(left), with left and lost the sums of moment s V
    over bonds that stay and that break.
    """
    broken, released, left, lost = 0, 0.0, 0.0, 0.0
    block = points.block[i]
    for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
        if not is_alive(bonds, i, k):
            continue
        j = neighbour(bonds, i, k)
        measure, _, _, _, _, _ = bond_strain(bonds, points, i, j, k, linear, third)
        s, inv_l = stretch_of(measure, linear), inverse_length(bonds, i, k)
        moment = moment_weight(law, weighting_between(law.weighting, block, points.block[j]), inv_l) * share(bonds, i, k)
        if fails(law.failure, law, points, state, i, j, inv_l, measure, linear):
            break_bond(bonds, i, k)
            at = released_stretch(law.failure, law, points, state, i, j, inv_l, s)
            released += bond_energy(law, near_end(law, points, state, i, j), moment, at) * points.volume[j]
            lost += moment * at * points.volume[j]
            broken += 1
        else:
            left += moment * s * points.volume[j]
    if broken:
        near, spherical = near_end(law, points, state, i, i), spherical_part(law, block)
        released += (volume_energy(law, near, spherical, left + lost) - volume_energy(law, near, spherical, left)) * over_energy(bonds, i)
        dissipated[i] += points.volume[i] * released
    return broken
