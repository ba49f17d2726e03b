"""Whether the particles of bodies that stand in files keep apart: no two too close for their sizes, no family fuller than space."""
import numpy as np

from pdhpc.jit import kernel

CLOSEST_OTHER = 0.25
"""Least distance of two particles of different bodies, in mean sizes of both: cells of a side ratio up to 16 may face each other."""
CLOSEST_OWN = 0.01
"""The same of two particles of one body."""
FULLEST = 1.5
"""Most volume in a family with particles of several bodies, in volumes of its balls: two bodies in one place come to 2."""


def find_crowded(subdomain, size, body, ball):
    """Return None, or (i, j, fullness), rows of Particles.id: two particles too close (fullness 0), or one of each body of a family that is too full. Local.

    size : (n_owned + n_ghost,) m, sides of squares or cubes of the particles' volumes. body : (n_owned + n_ghost,) int, the body of each.
    ball : (n_body, n_body) m^3, volume within the family radius by the bodies of both ends. Bodies without bonds between them do not see each other.
    """
    found = np.full(2, -1)
    fullness = _search(subdomain.bonds.arrays.row_start, subdomain.bonds.arrays.neighbour, subdomain.bonds.arrays.inv_length, subdomain.bonds.family_size,
                       size, subdomain.particles.volume, body, ball, (CLOSEST_OWN, CLOSEST_OTHER, FULLEST), found)
    return None if found[0] < 0 else (int(found[0]), int(found[1]), fullness)


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
