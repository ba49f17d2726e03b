"""Bond forces that fade out: a lattice's particles hand their forces over to another model across a ramp alpha, 1 to 0.

    F_p = sum_q f_pq,   F^alpha_p = sum_q (alpha_p + alpha_q)/2 f_pq = (alpha_p F_p + sum_q alpha_q f_pq)/2,   f_pq = pull V_q xi.

One pass over the bonds of eight particles gives both; F^alpha goes into two weighted sums over the sub-steps of a run, its impulse and its moment.
"""
import numpy as np

from pdhpc.jit import inlined, kernel, sweep
from pdhpc.kernels.family import MIXED, bond_strain, inverse_length, is_alive, neighbour
from pdhpc.kernels.lattice import WORD
from pdhpc.kernels.lattice_laws import bond_moduli, mixed_ends, uniform_ends
from pdhpc.kernels.reference import break_row
from pdhpc.kernels.simd import LANES, any_of, as_vector, at, both, chosen, either, fma, has_bit, lane_mask, load8, select, splat, store8, words8
from pdhpc.materials.law import bond_energy, bond_weight, far_end, moment_weight, near_end, pull


@sweep
def blended_forces(bonds, points, law, third, rows, alpha, moving, force_density, dissipated, weights, impulse, moment, seen):
    """Compute F_p of the rows and add their F^alpha_p to two sums; break bonds beyond their limit, as sweeps.bond_forces does. Linear kinematics.

    Parameters
    ----------
    bonds : LatticeArrays. points, law, third, rows, force_density, dissipated : as of sweeps.bond_forces. alpha : (n_slots,), 0 to 1.
    moving : (n_slots,), above 0 for particles that move by themselves: only their bonds are watched for breaking.
    weights : (2,): impulse += weights[0] F^alpha, moment += weights[1] F^alpha. impulse, moment : (n_rows, dim, 8), of the eight particles of each row.
    seen : (n_rows,) bool, set of rows with a bond beyond bonds.trigger that is watched. A trigger below that of the limit makes this a look at strains; what
    breaks is the same.

    Returns
    -------
    int, directed bonds broken in this evaluation.
    """
    broken, settled = 0, -1
    t, beyond = _sum_blended(0, settled, bonds, points, law, third, rows, alpha, moving, force_density, weights, impulse, moment)
    while beyond:
        newly_broken, seen[t] = 0, True
        for i in range(rows[t], rows[t] + LANES):
            newly_broken += break_row(bonds, i, points, law, None, True, third, dissipated)
        broken += newly_broken
        settled = t if newly_broken == 0 else -1
        t, beyond = _sum_blended(t, settled, bonds, points, law, third, rows, alpha, moving, force_density, weights, impulse, moment)
    return broken


@sweep
def _sum_blended(first, settled, bonds, points, law, third, rows, alpha, moving, force_density, weights, impulse, moment):
    """Go through the rows from `first` on, up to the first with a bond that may be beyond its limit; of the row `settled` it is known that none is."""
    for t in range(first, len(rows)):
        i = rows[t]
        kind = bonds.kind[i >> 3]
        if kind == MIXED:
            near, row = mixed_ends(law, None, i), len(bonds.weight) - 1
            beyond = _blend_eight(bonds, i, t, points, law, third, alpha, moving, force_density, weights, impulse, moment, near, row, t != settled)
        else:
            same = uniform_ends(law, None, i)
            beyond = _blend_eight(bonds, i, t, points, law, third, alpha, moving, force_density, weights, impulse, moment, same, np.int64(kind), t != settled)
        if beyond:
            return t, True
    return len(rows), False


@inlined
def _blend_eight(bonds, i, t, points, law, third, alpha, moving, force_density, weights, impulse, moment, near, row, unsettled):
    """Sum the forces on eight particles; return whether a bond may be beyond its limit, in which case the sums over sub-steps are left alone."""
    position, n, count = points.position, len(points.position), len(bonds.offset)
    dim = 2 if third is None else 3
    px, py = load8(position, i), load8(position, n + i)
    pz = splat(0.0) if third is None else load8(position, 2 * n + i)
    fx, fy, fz, gx, gy, gz = splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    beyond = lane_mask(np.uint8(0))
    for word in range(bonds.alive.shape[0]):
        states = words8(bonds.alive, word * n + i)
        for k in range(WORD * word, min(count, WORD * word + WORD)):
            j = i + at(bonds.offset, k)
            dx, dy = splat(at(bonds.vector, dim * k)), splat(at(bonds.vector, dim * k + 1))
            dz = splat(0.0) if third is None else splat(at(bonds.vector, dim * k + 2))
            ex, ey = load8(position, j) - px, load8(position, n + j) - py
            along2 = fma(dx, ex, dy * ey) if third is None else fma(dx, ex, fma(dy, ey, dz * (load8(position, 2 * n + j) - pz)))
            live = has_bit(states, k - WORD * word)
            beyond = either(beyond, both(live, along2 > at(bonds.trigger, row * count + k)))
            c, p = bond_moduli(near, law, points, None, i, j)
            weight, stretch = at(bonds.weight, row * count + k), along2 * (at(bonds.inv_length, k) * at(bonds.inv_length, k))
            tension = select(live, fma(as_vector(weight * c), stretch, as_vector(weight * p)), splat(0.0))
            shared = tension * load8(alpha, j)
            fx, fy = fma(tension, dx, fx), fma(tension, dy, fy)
            gx, gy = fma(shared, dx, gx), fma(shared, dy, gy)
            if third is not None:
                fz, gz = fma(tension, dz, fz), fma(shared, dz, gz)
    if unsettled and any_of(both(beyond, load8(moving, i) > 0.0)):
        return True
    store8(force_density, i, fx)
    store8(force_density, n + i, fy)
    if third is not None:
        store8(force_density, 2 * n + i, fz)
    own, first = load8(alpha, i), LANES * dim * t
    _add(impulse, moment, first, weights, 0.5 * fma(own, fx, gx))
    _add(impulse, moment, first + LANES, weights, 0.5 * fma(own, fy, gy))
    if third is not None:
        _add(impulse, moment, first + 2 * LANES, weights, 0.5 * fma(own, fz, gz))
    return False


@inlined
def _add(impulse, moment, first, weights, blended):
    """Add one component of F^alpha of eight particles to both sums."""
    store8(impulse, first, fma(splat(weights[0]), blended, load8(impulse, first)))
    store8(moment, first, fma(splat(weights[1]), blended, load8(moment, first)))


@kernel
def blended_forces_by_bond(bonds, points, law, third, rows, alpha, moving, force_density, dissipated, weights, impulse, moment, seen):
    """As blended_forces, bond by bond: its readable twin, for processors without wide vectors."""
    broken, dim = 0, 2 if third is None else 3
    total = np.zeros(3)
    faded = np.zeros(3)
    for t in range(len(rows)):
        kind = bonds.kind[rows[t] >> 3]
        limit = bonds.trigger[len(bonds.weight) - 1 if kind == MIXED else np.int64(kind)]
        for lane in range(LANES):
            i = rows[t] + lane
            for k in range(len(bonds.offset)):
                if moving[i] > 0.0 and is_alive(bonds, i, k):
                    seen[t] |= bond_strain(bonds, points, i, neighbour(bonds, i, k), k, True, third)[1] > limit[k] * inverse_length(bonds, i, k) ** 2
            broken += break_row(bonds, i, points, law, None, True, third, dissipated)
            total[:] = 0.0
            faded[:] = 0.0
            for k in range(len(bonds.offset)):
                if is_alive(bonds, i, k):
                    j = neighbour(bonds, i, k)
                    _, stretch, shrink, dx, dy, dz = bond_strain(bonds, points, i, j, k, True, third)
                    weight = bond_weight(law, law.weighting, inverse_length(bonds, i, k))
                    tension = pull(law, near_end(law, points, None, i, j), far_end(law, None, j), weight, stretch, shrink)
                    along = (dx, dy, dz)
                    for d in range(dim):
                        total[d] += tension * points.volume[j] * along[d]
                        faded[d] += alpha[j] * tension * points.volume[j] * along[d]
            for d in range(dim):
                force_density[i, d] = total[d]
                blended = 0.5 * (alpha[i] * total[d] + faded[d])
                impulse[t, d, lane] += weights[0] * blended
                moment[t, d, lane] += weights[1] * blended
    return broken


if chosen() == "reference":
    blended_forces = blended_forces_by_bond


@sweep
def blended_energies(bonds, points, law, third, slots, alpha, energy):
    """Store sum_q (alpha_p + alpha_q)/2 w_pq V_q / 2, J/m^3, of the particles in `slots` (n,) in energy (n,); w_pq the energy of each intact bond."""
    for n in range(len(slots)):
        i, total = slots[n], 0.0
        for k in range(len(bonds.offset)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                stretch = bond_strain(bonds, points, i, j, k, True, third)[1]
                part = moment_weight(law, law.weighting, inverse_length(bonds, i, k)) * points.volume[j]
                total += 0.5 * (alpha[i] + alpha[j]) * bond_energy(law, near_end(law, points, None, i, j), part, stretch)
        energy[n] = total


@sweep
def find_blended(bonds, block, slots, alpha, status):
    """Store in status (n,) of the particles in `slots` what alpha is as far as their bonds, broken or not, reach: 0 nowhere above 0, 2 everywhere 1, else 1."""
    for n in range(len(slots)):
        i = slots[n]
        none, whole = alpha[i] == 0.0, alpha[i] == 1.0
        for k in range(len(bonds.offset)):
            j = i + bonds.offset[k]
            if block[j] != MIXED:
                none, whole = none and alpha[j] == 0.0, whole and alpha[j] == 1.0
        status[n] = 0 if none else (2 if whole else 1)


@sweep
def strained_or_broken(bonds, points, law, third, slots, share, flags):
    """Mark in flags (n,) the particles in `slots` (n,) with a bond beyond `share` of their critical stretch, or with a broken one, pre-cracks included."""
    for n in range(len(slots)):
        i, found = slots[n], False
        limit = share * law.break_at[points.block[i], points.block[i]]
        for k in range(len(bonds.offset)):
            if is_alive(bonds, i, k):
                found |= bond_strain(bonds, points, i, neighbour(bonds, i, k), k, True, third)[0] > limit
            else:
                found |= points.block[i + bonds.offset[k]] != MIXED
        flags[n] = found


@sweep
def strained_rows(bonds, points, rows, moving, share, seen):
    """Set seen (n_rows,) of rows of eight with a bond that may be beyond `share` of its limit, or the smallest limit around; moving (n_slots,), as of
    blended_forces. 2D, linear kinematics."""
    position, n, count = points.position, len(points.position), len(bonds.offset)
    for t in range(len(rows)):
        i = rows[t]
        kind = bonds.kind[i >> 3]
        row = len(bonds.weight) - 1 if kind == MIXED else np.int64(kind)
        px, py, beyond, watched = load8(position, i), load8(position, n + i), lane_mask(np.uint8(0)), load8(moving, i) > 0.0
        if not any_of(watched):
            continue
        for word in range(bonds.alive.shape[0]):
            states = words8(bonds.alive, word * n + i)
            for k in range(WORD * word, min(count, WORD * word + WORD)):
                j = i + at(bonds.offset, k)
                along2 = fma(splat(at(bonds.vector, 2 * k)), load8(position, j) - px, at(bonds.vector, 2 * k + 1) * (load8(position, n + j) - py))
                beyond = either(beyond, both(has_bit(states, k - WORD * word), along2 > share * at(bonds.trigger, row * count + k)))
        seen[t] |= any_of(both(beyond, watched))


@kernel
def lattice_moduli(bonds, points, law, third, slots, result):
    """Store C_p = 1/2 sum_q c omega beta V |xi| (e e)(e e), Pa, of the particles in `slots` (n,), intact bonds only, in result (n, s, s).

    In Voigt's notation, with v = (e_x^2, e_y^2, e_x e_y), 3D (e_x^2, e_y^2, e_z^2, e_y e_z, e_x e_z, e_x e_y), C_p = sum_q (...) v v^T: the energy density of a
    particle under uniform strain, shear strains counted as angles, is eps . C_p eps / 2.
    """
    v = np.zeros(6)
    for n in range(len(slots)):
        i = slots[n]
        result[n] = 0.0
        for k in range(len(bonds.offset)):
            if is_alive(bonds, i, k):
                j, inv_l = neighbour(bonds, i, k), inverse_length(bonds, i, k)
                x, y = bonds.vector[k, 0] * inv_l, bonds.vector[k, 1] * inv_l
                if third is None:
                    v[0], v[1], v[2] = x * x, y * y, x * y
                else:
                    z = bonds.vector[k, 2] * inv_l
                    v[0], v[1], v[2], v[3], v[4], v[5] = x * x, y * y, z * z, y * z, x * z, x * y
                part = 2.0 * bond_energy(law, near_end(law, points, None, i, j), moment_weight(law, law.weighting, inv_l) * points.volume[j], 1.0)
                for a in range(result.shape[1]):
                    for b in range(result.shape[1]):
                        result[n, a, b] += part * v[a] * v[b]
