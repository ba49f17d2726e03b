"""Whether the particles of bodies that stand in files keep apart: no two too close for their sizes, no family fuller than space."""
import numpy as np

from pdhpc.jit import kernel

CLOSEST_OTHER = 0.25
"""Least distance of two particles of different bodies, in mean sizes of both: cells of a side ratio up to 16 may face each other."""
CLOSEST_OWN = 0.01
"""The same of two particles of one body."""
FULLEST = 1.5
"""Most volume in a family with particles of several bodies, in volumes of its balls: two bodies in one place come to 2."""

NEAREST_OTHER = 0.75
"""The share of the distance of the nearest particle of the own body, and of the mean size, at which another body's particle is suspiciously near: where two
square lattices lie over each other each particle has one within 1/sqrt(2) spacings."""
FACING = 1.5
"""Distance, in mean sizes, up to which a particle of another body faces one."""


def find_crowded(subdomain, size, body, ball):
    """Return None, or (i, j, fullness), rows of Particles.id: two particles too close (fullness 0), or one of each body of a family that is too full. Local.

    size : (n_owned + n_ghost,) m, sides of squares or cubes of the particles' volumes. body : (n_owned + n_ghost,) int, the body of each.
    ball : (n_body, n_body) m^3, volume within the family radius by the bodies of both ends. Bodies without bonds between them do not see each other.
    """
    found = np.full(2, -1)
    fullness = _search(subdomain.bonds.arrays.row_start, subdomain.bonds.arrays.neighbour, subdomain.bonds.arrays.inv_length, subdomain.bonds.family_size,
                       size, subdomain.particles.volume, body, ball, (CLOSEST_OWN, CLOSEST_OTHER, FULLEST), found)
    return None if found[0] < 0 else (int(found[0]), int(found[1]), fullness)


def find_close(subdomain, size, body):
    """Return (close, facing, i, j): owned particles with one of another body suspiciously near (NEAREST_OTHER), with one facing it (FACING), rows of the first close pair or -1. Local.

    size, body : as of find_crowded, for bonds in lists.
    """
    found = np.full(2, -1)
    bonds = subdomain.bonds
    close, facing = _count_close(bonds.arrays.row_start, bonds.arrays.neighbour, bonds.arrays.inv_length, bonds.family_size, size, body, (NEAREST_OTHER, FACING), found)
    return int(close), int(facing), int(found[0]), int(found[1])


@kernel
def _count_close(row_start, neighbour, inv_length, counts, size, body, limits, found):
    """Count the particles whose nearest one of another body is nearer than a share of both the nearest one of their own and the mean size; set found by the first. Return (close, facing)."""
    share, face = limits
    close = facing = 0
    for i in range(len(counts)):
        own, other, stranger = 0.0, 0.0, -1  # one over the distance
        for k in range(row_start[i], row_start[i] + counts[i]):
            if body[neighbour[k]] == body[i]:
                own = max(own, inv_length[k])
            elif inv_length[k] > other:
                other, stranger = inv_length[k], neighbour[k]
        mean = 0.0 if stranger < 0 else 0.5 * (size[i] + size[stranger])
        facing += other * face * mean > 1.0
        if share * other > own and other * share * mean > 1.0:
            if close == 0:
                found[0], found[1] = i, stranger
            close += 1
    return close, facing


@kernel
def _search(row_start, neighbour, inv_length, counts, size, volume, body, ball, limits, found):
    """Set found to the ends of the first pair beyond a limit; return the fullness of its family, 0 for a pair too close or none."""
    own, other, fullest = limits
    for i in range(len(counts)):
        held, stranger = volume[i] / ball[body[i], body[i]], -1
        for k in range(row_start[i], row_start[i] + counts[i]):
            j = neighbour[k]
            held += volume[j] / ball[body[i], body[j]]
            if body[j] != body[i]:
                stranger = j
            least = 0.5 * (size[i] + size[j]) * (own if body[j] == body[i] else other)
            if inv_length[k] * least > 1.0:
                found[0], found[1] = i, j
                return 0.0
        if stranger >= 0 and held > fullest:
            found[0], found[1] = i, stranger
            return held
    return 0.0
