"""Sweeps over bond states: counting them, cutting them along pre-cracks, finding what lies beside a particle."""
import numpy as np

from pdhpc.jit import inlined, kernel
from pdhpc.kernels.family import break_bond, count_alive, end_of_bonds, first_bond, is_alive, neighbour, place, reference_vector

_EDGE = 1e-9  # relative: a crossing point this far outside the rim still counts as on the crack


@kernel
def count_intact(bonds, slots, counts):
    """Store the number of intact bonds of the particles in `slots` (n,) in counts (n,)."""
    for n in range(len(slots)):
        counts[n] = count_alive(bonds, slots[n])


@kernel
def spread_bytes(alive, first, count, rows):
    """Store alive[first[n] : first[n] + count[n]] in rows[n] (n, width)."""
    for n in range(len(first)):
        for byte in range(count[n]):
            rows[n, byte] = alive[first[n] + byte]


@kernel
def collect_bytes(rows, first, count, alive):
    """Store the first count[n] of rows[n] (n, width) in alive, from first[n] on."""
    for n in range(len(first)):
        for byte in range(count[n]):
            alive[first[n] + byte] = rows[n, byte]


@kernel
def foremost_damaged(bonds, slots, initial_size, threshold, members, ahead):
    """Return the m whose members[m] (owned index) has a damage 1 - intact/initial above `threshold` with the largest ahead[m], m; -1 if none."""
    best, best_ahead = -1, -np.inf
    for m in range(len(members)):
        n = members[m]
        if ahead[m] > best_ahead and initial_size[n] > 0 and 1.0 - count_alive(bonds, slots[n]) / initial_size[n] > threshold:
            best, best_ahead = m, ahead[m]
    return best


@kernel
def cut_bonds(bonds, points, slots, origin, normal, along, radius):
    """Cut the bonds of the particles in `slots` (n,) that cross the piece of a crack (geometry/cracks.py); return how many.

    A bond is cut when its ends lie on different sides of the piece's line or plane and the crossing point lies on the piece. A point on the line or plane
    itself counts as lying on its positive side, so that a crack along a row of particles still separates the body in two.
    """
    dim, cut = len(origin), 0
    crossing = np.empty(3)
    for n in range(len(slots)):
        i = slots[n]
        at_i = place(bonds, points, i)
        side_i = _side(at_i, origin, normal)
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if not is_alive(bonds, i, k):
                continue
            at_j = place(bonds, points, neighbour(bonds, i, k))
            side_j = _side(at_j, origin, normal)
            if (side_i >= 0.0) == (side_j >= 0.0):
                continue
            fraction = side_i / (side_i - side_j)
            for d in range(dim):
                crossing[d] = at_i[d] + fraction * (at_j[d] - at_i[d])
            if _on_piece(crossing, origin, along, radius):
                break_bond(bonds, i, k)
                cut += 1
    return cut


@inlined
def _side(at, origin, normal):
    """Return the signed distance of a point from the piece's plane, m."""
    side = 0.0
    for d in range(len(origin)):
        side += (at[d] - origin[d]) * normal[d]
    return side


@kernel
def _on_piece(place, origin, along, radius):
    """Whether a point of the piece's plane lies within its rim."""
    dim = len(origin)
    if radius > 0.0:
        distance2 = 0.0
        for d in range(dim):
            distance2 += (place[d] - origin[d]) ** 2
        return distance2 <= (radius * (1.0 + _EDGE)) ** 2
    for e in range(dim - 1):
        coordinate = 0.0
        for d in range(dim):
            coordinate += (place[d] - origin[d]) * along[e, d]
        if coordinate < -_EDGE or coordinate > 1.0 + _EDGE:
            return False
    return True


@kernel
def count_face(bonds, points, third, slots, selected, axis, step):
    """Count the selected particles of `slots` (n,) with no selected neighbour one lattice spacing away along an axis: the face a traction acts on.

    selected (n_slots,) bool, owned and ghosts; axis : int; step : signed spacing, m.
    """
    count = 0
    for n in range(len(slots)):
        i = slots[n]
        if not selected[i]:
            continue
        covered = False
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            j = neighbour(bonds, i, k)
            xi = reference_vector(bonds, points, i, j, k, third)
            apart = 0.0
            for d in range(3):
                apart = max(apart, abs(xi[d] - (step if d == axis else 0.0)))
            if selected[j] and apart < 0.25 * abs(step):
                covered = True
                break
        count += not covered
    return count
