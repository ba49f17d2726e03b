"""Sweeps over pairs of particles that are near each other and not bonded: short-range repulsion, friction, damping.

Of a pair in contact, d_ij = min(0.9 |X_j - X_i|, reach_i + reach_j), r = |x_j - x_i| < d_ij, n = (x_j - x_i)/r, stiffness k = s V_i V_j (N/m, s in N/m^7),
m = m_i m_j/(m_i + m_j) and w = v_j - v_i (half-step velocities):

    N = max(0, k (d_ij - r) - 2 damping sqrt(k m) w.n),   T = min(friction N, m |w_t|/(4 dt)),   F_i = -N n + T w_t/|w_t| = -F_j

(repulsion: Silling & Askari 2005, Parks et al. 2008; dashpot: Cundall & Strack 1979; Coulomb friction, regularised by what would bring the pair to rest).
Every term changes sign exactly when i and j trade places; each pair is evaluated at both ends, in ascending global id of the other, so that the sums have
the same bits on any number of ranks.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import inlined, kernel
from pdhpc.kernels.family import count_alive, end_of_bonds, first_bond, frequency_row, is_alive, neighbour, row_width
from pdhpc.kernels.neighbours import Cells

_CLOSEST = 0.9
"""Share of their reference distance within which two particles may repel: none do in the unloaded body (Parks et al. 2008)."""

SEAM = 1.0 + 1e-9
"""The search radius is this much larger than the largest distance that counts."""


class MetPoints(NamedTuple):
    """Particles that may meet, by number: the owned ones in ascending id, then ghosts.

    motion (n, dim or 2 dim), m and m/s: current positions, and half-step velocities where forces depend on them; reference (n, dim), m; reach (n,), m;
    volume (n,), m^3; block (n,) uint8; slot (n,) int32, where the subdomain holds it, -1 for a ghost of which it knows nothing.
    """

    motion: np.ndarray
    reference: np.ndarray
    reach: np.ndarray
    volume: np.ndarray
    block: np.ndarray
    slot: np.ndarray


class ContactLaw(NamedTuple):
    """stiffness (n_block, n_block), N/m^7; density (n_block,), kg/m^3; friction, damping; dt, s."""

    stiffness: np.ndarray
    density: np.ndarray
    friction: float
    damping: float
    dt: float


class Crowd(NamedTuple):
    """Some of the points: cells : neighbours.Cells of them, `order` their numbers in MetPoints. allowance : the largest of theirs, m."""

    cells: Cells
    allowance: float


class Pairs(NamedTuple):
    """Near pairs: of owned particle i the entries start[i] to start[i + 1], in ascending id of the other end.

    start (n_owned + 1,) int64; other (n,) int32, numbers in MetPoints; free (n,) uint8, 1 where no intact bond joins the pair.
    """

    start: np.ndarray
    other: np.ndarray
    free: np.ndarray


@inlined
def _apart(points, i, j, third):
    """Return (d_ij - r, r, x, y, z) of a pair, (x, y, z) = x_j - x_i, m; d_ij - r is 0 where they do not touch."""
    dx, dy = points.motion[j, 0] - points.motion[i, 0], points.motion[j, 1] - points.motion[i, 1]
    dz = 0.0 if third is None else points.motion[j, 2] - points.motion[i, 2]
    r2, limit = dx * dx + dy * dy + dz * dz, points.reach[i] + points.reach[j]
    if r2 >= limit * limit:
        return 0.0, limit, dx, dy, dz
    r = np.sqrt(r2)
    return max(0.0, min(limit, _CLOSEST * _reference_distance(points, i, j, third)) - r), r, dx, dy, dz


@inlined
def _reference_distance(points, i, j, third):
    """Return |X_j - X_i|, m."""
    x, y = points.reference[j, 0] - points.reference[i, 0], points.reference[j, 1] - points.reference[i, 1]
    z = 0.0 if third is None else points.reference[j, 2] - points.reference[i, 2]
    return np.sqrt(x * x + y * y + z * z)


@inlined
def _spring(points, law, i, j):
    """Return (k, m) of a pair, N/m and kg."""
    k = law.stiffness[points.block[i], points.block[j]] * (points.volume[i] * points.volume[j])
    m_i, m_j = law.density[points.block[i]] * points.volume[i], law.density[points.block[j]] * points.volume[j]
    return k, m_i * m_j / (m_i + m_j)


@kernel
def gather(position, velocity, slots, numbers, dim, motion):
    """Store positions, and half-step velocities where `motion` has columns for them, of the owned particles `numbers` (n,), in motion."""
    for n in range(len(numbers)):
        i, s = numbers[n], slots[numbers[n]]
        for d in range(dim):
            motion[i, d] = position[s, d]
        if motion.shape[1] > dim:
            for d in range(dim):
                motion[i, dim + d] = velocity[s, d]


@kernel
def add_contact_forces(pairs, points, law, third, rows, force_density, inelastic, given):
    """Add the contact force densities of the owned particles in `rows` (n,) to force_density (n_slots, dim), N/m^3.

    inelastic : None, or (n_slots, dim), N: overwritten by the part that friction and damping have in them, or taken as that where `given`.
    """
    for t in range(len(rows)):
        i = rows[t]
        fx, fy, fz, gx, gy, gz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for e in range(pairs.start[i], pairs.start[i + 1]):
            if pairs.free[e] == 0:
                continue
            j = pairs.other[e]
            overlap, r, dx, dy, dz = _apart(points, i, j, third)
            if overlap <= 0.0:
                continue
            k, m = _spring(points, law, i, j)
            nx, ny, nz = dx / r, dy / r, dz / r
            elastic = k * overlap
            if inelastic is not None and not given:
                hx, hy, hz = _resistance(points, law, i, j, third, k, m, elastic, nx, ny, nz)
                gx += hx
                gy += hy
                gz += hz
            fx -= elastic * nx
            fy -= elastic * ny
            fz -= elastic * nz
        s, volume = points.slot[i], points.volume[i]
        if inelastic is not None and given:
            gx, gy, gz = inelastic[s, 0], inelastic[s, 1], 0.0 if third is None else inelastic[s, 2]
        force_density[s, 0] += (fx + gx) / volume
        force_density[s, 1] += (fy + gy) / volume
        if third is not None:
            force_density[s, 2] += (fz + gz) / volume
        if inelastic is not None:
            inelastic[s, 0], inelastic[s, 1] = gx, gy
            if third is not None:
                inelastic[s, 2] = gz


@inlined
def _resistance(points, law, i, j, third, k, m, elastic, nx, ny, nz):
    """Return what damping and friction add to the force on i, N."""
    d = 2 if third is None else 3
    wx, wy = points.motion[j, d] - points.motion[i, d], points.motion[j, d + 1] - points.motion[i, d + 1]
    wz = 0.0 if third is None else points.motion[j, d + 2] - points.motion[i, d + 2]
    along = wx * nx + wy * ny + wz * nz
    normal = max(0.0, elastic - 2.0 * law.damping * np.sqrt(k * m) * along)
    tx, ty, tz = wx - along * nx, wy - along * ny, wz - along * nz
    slip = np.sqrt(tx * tx + ty * ty + tz * tz)
    drag = 0.0 if slip == 0.0 else min(law.friction * normal, m * slip / (4.0 * law.dt)) / slip
    push = normal - elastic
    return drag * tx - push * nx, drag * ty - push * ny, drag * tz - push * nz


@kernel
def contact_energies(pairs, points, law, third, rows, energy):
    """Store half of k (d_ij - r)^2/2, J, of each touching pair of the owned particles `rows` (n,) in energy (n_owned,)."""
    for t in range(len(rows)):
        i = rows[t]
        energy[i] = 0.0
        for e in range(pairs.start[i], pairs.start[i + 1]):
            if pairs.free[e] != 0:
                overlap, _, _, _, _ = _apart(points, i, pairs.other[e], third)
                if overlap > 0.0:
                    energy[i] += 0.25 * _spring(points, law, i, pairs.other[e])[0] * overlap * overlap


@kernel
def lose(inelastic, velocity, slots, numbers, half_dt, loss):
    """Subtract the work of `inelastic` (n_slots, dim), N, over half a step from loss (n_owned,), J, of the owned particles `numbers`."""
    for t in range(len(numbers)):
        i, s = numbers[t], slots[numbers[t]]
        power = 0.0
        for d in range(velocity.shape[1]):
            power += inelastic[s, d] * velocity[s, d]
        loss[i] -= half_dt * power


@kernel
def list_near(crowds, distance, points, allowance, ids, third, bonds, drop, stamp, start, other):
    """List the particles within d_ij + a_i + a_j of each owned one, in ascending id; return how many. What does not fit in `other` is counted only.

    crowds : two of Crowd that together are all points. distance : m, at least the largest d_ij. allowance (n_points,), m, a. drop : whether to leave out pairs that
    an intact bond joins. stamp (n_slots,) bool, scratch, False throughout before and after. start (n_owned + 1,) int64, other (capacity,) int32: of Pairs.
    """
    end = np.int64(0)
    for i in range(len(start) - 1):
        start[i] = end
        if drop:
            _stamp_bonded(bonds, points.slot[i], stamp)
        for crowd in crowds:
            if len(crowd.cells.order):
                end = _list_of(crowd, distance, points, allowance, ids, third, drop, stamp, i, start[i], end, other)
        if drop:
            _wipe(bonds, points.slot[i], stamp)
    start[len(start) - 1] = end
    return end


@inlined
def _list_of(crowd, distance, points, allowance, ids, third, drop, stamp, i, begin, end, other):
    """Add those of a crowd that are near particle i to its row, other[begin:end]; return the new end."""
    cells, position, per_length = crowd.cells, crowd.cells.position, crowd.cells.per_length
    nx, ny, nz = cells.counts[0], cells.counts[1], cells.counts[2]
    x, y = points.motion[i, 0], points.motion[i, 1]
    z = 0.0 if third is None else points.motion[i, 2]
    cx, cy, cz = x - cells.lower[0], y - cells.lower[1], z - cells.lower[2]
    radius = (distance + allowance[i] + crowd.allowance) * SEAM
    bottom, top = max(0, np.int64((cz - radius) * per_length)), min(nz - 1, np.int64((cz + radius) * per_length))
    if bottom > top:
        return end
    for a in range(max(0, np.int64((cx - radius) * per_length)), min(nx - 1, np.int64((cx + radius) * per_length)) + 1):
        for b in range(max(0, np.int64((cy - radius) * per_length)), min(ny - 1, np.int64((cy + radius) * per_length)) + 1):
            column = (a * ny + b) * nz
            for s in range(cells.start[column + bottom], cells.start[column + top + 1]):
                dx, dy, dz = position[s, 0] - x, position[s, 1] - y, position[s, 2] - z
                r2 = dx * dx + dy * dy + dz * dz
                if r2 >= radius * radius:
                    continue
                j = cells.order[s]
                if j == i or (drop and points.slot[j] >= 0 and stamp[points.slot[j]]):
                    continue
                limit = min(points.reach[i] + points.reach[j], _CLOSEST * _reference_distance(points, i, j, third)) + (allowance[i] + allowance[j])
                if r2 < limit * limit:
                    if end < len(other):
                        _insert(ids, j, begin, end, other)
                    end += 1
    return end


@inlined
def _insert(ids, j, first, end, other):
    """Put j into its place by id among other[first:end]."""
    e = end
    while e > first and ids[other[e - 1]] > ids[j]:
        other[e] = other[e - 1]
        e -= 1
    other[e] = j


@inlined
def _stamp_bonded(bonds, s, stamp):
    """Mark in stamp (n_slots,) bool the other ends of the intact bonds of slot s; without branches, which broken bonds would make hard to foresee."""
    for k in range(first_bond(bonds, s), end_of_bonds(bonds, s)):
        stamp[neighbour(bonds, s, k)] |= is_alive(bonds, s, k)


@inlined
def _wipe(bonds, s, stamp):
    """Take back what _stamp_bonded marked."""
    for k in range(first_bond(bonds, s), end_of_bonds(bonds, s)):
        stamp[neighbour(bonds, s, k)] = False


@kernel
def free_pairs(bonds, pairs, points, stamp, intact, alive, met):
    """Bring pairs.free up to date of the rows whose number of intact bonds is no longer intact (n_owned,), which it becomes; fill alive (n_owned,) bool.

    alive[i] : whether row i has a free pair; if so, it and the other ends of its free pairs are marked in met (n_points,) bool. stamp as of list_near.
    """
    for i in range(len(pairs.start) - 1):
        s = points.slot[i]
        now = count_alive(bonds, s)
        if now == intact[i] or pairs.start[i] == pairs.start[i + 1]:
            continue
        intact[i] = now
        if now:
            _stamp_bonded(bonds, s, stamp)
        alive[i] = False
        for e in range(pairs.start[i], pairs.start[i + 1]):
            j = points.slot[pairs.other[e]]
            if j < 0 or not stamp[j]:
                pairs.free[e], alive[i], met[pairs.other[e]] = 1, True, True
            else:
                pairs.free[e] = 0
        met[i] |= alive[i]
        if now:
            _wipe(bonds, s, stamp)


@kernel
def mark_met(pairs, rows, met):
    """Mark in met (n_points,) bool the owned particles `rows` and the other ends of their free pairs."""
    for t in range(len(rows)):
        met[rows[t]] = True
        for e in range(pairs.start[rows[t]], pairs.start[rows[t] + 1]):
            if pairs.free[e] != 0:
                met[pairs.other[e]] = True


@kernel
def stiffest(pairs, points, law, third, rows, bonds, body, bond_law, state):
    """Return the largest (|A| + |A_c|)/rho, 1/s^2, of the owned particles `rows`: A of their bonds, |A_c| <= sum k/V of the pairs that touch (Frobenius norm).

    bonds, body (PointArrays), bond_law, state : as of sweeps.largest_frequency2.
    """
    largest = 0.0
    width = row_width(bonds)
    for t in range(len(rows)):
        i = rows[t]
        xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for e in range(pairs.start[i], pairs.start[i + 1]):
            if pairs.free[e] == 0:
                continue
            overlap, r, dx, dy, dz = _apart(points, i, pairs.other[e], third)
            if overlap > 0.0:
                k = _spring(points, law, i, pairs.other[e])[0] / (r * r)
                xx += k * dx * dx
                yy += k * dy * dy
                zz += k * dz * dz
                xy += k * dx * dy
                xz += k * dx * dz
                yz += k * dy * dz
        norm = np.sqrt(xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz))
        if norm > 0.0:
            own = frequency_row(bonds, points.slot[i] // width * width, body, bond_law, state, third)
            largest = max(largest, own + norm / (law.density[points.block[i]] * points.volume[i]))
    return largest


@kernel
def largest_motion(displacement, before, velocity, slots, allowance, dt):
    """Return (largest |u - u_before|, m, largest |v|, m/s, least a - |u - u_before|, m, largest (|u - u_before| - |v| dt)/a) of the particles in `slots` (n,).

    allowance (n,), m, a. NaN counts as infinite.
    """
    farthest, fastest, least, before_last = 0.0, 0.0, np.inf, 0.0
    for n in range(len(slots)):
        s, u2, v2 = slots[n], 0.0, 0.0
        for d in range(displacement.shape[1]):
            u2 += (displacement[s, d] - before[s, d]) ** 2
            v2 += velocity[s, d] ** 2
        if not u2 < np.inf or not v2 < np.inf:
            return np.inf, np.inf, -np.inf, np.inf
        moved, speed = np.sqrt(u2), np.sqrt(v2)
        farthest, fastest = max(farthest, moved), max(fastest, speed)
        least, before_last = min(least, allowance[n] - moved), max(before_last, (moved - speed * dt) / allowance[n])
    return farthest, fastest, least, before_last


@kernel
def allow(velocity, slots, seconds, least, most, distance, allowance):
    """Store max(least, min(most, |v| seconds)), m, in allowance (n,) of the particles in `slots` (n,); return about how many times as many pairs are near then.

    distance : m, within which particles touch. The number is the mean of the volumes (distance + least + a)^dim over those with a = least.
    """
    dim, volumes = velocity.shape[1], 0.0
    for n in range(len(slots)):
        v2 = 0.0
        for d in range(dim):
            v2 += velocity[slots[n], d] ** 2
        allowance[n] = max(least, min(most, np.sqrt(v2) * seconds))
        volumes += ((distance + least + allowance[n]) / (distance + 2.0 * least)) ** dim
    return volumes / max(1, len(slots))
