"""The area of the face of a region whose particles differ in size: that of its shadow."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.parallel.comm import exact_sum, join_marks, largest, smallest

_FINE = 8  # pixels in the smallest particle's side
_MOST_PIXELS = {1: 1 << 22, 2: 1 << 11}  # of a side of the picture, by its dimension: at most 4 MB


def area_over_volume(comm, points, volume, thickness, axis):
    """Return A/V, 1/m: the area that a region shows to someone who looks along an axis, over its volume. Collective.

    Every particle counts as a square (2D) or cube of its volume, its sides along the axes; A is the area of their common shadow on the plane normal to the
    axis, times the thickness in 2D, measured on pixels of an eighth of the smallest one (on at most 2048^2 of them in 3D). On a lattice that is exact; it is
    the layer's face where the region is no thicker than it is meant to be, whichever way cells lie in it. The same bits on any number of ranks.

    points : (n, dim), m; volume : (n,), m^3, of this rank's particles in the region, each on one rank. thickness : m, 1 in 3D.
    """
    dim = points.shape[1]
    size = (volume / thickness) ** (1 / dim)
    across = [other for other in range(dim) if other != axis]
    lower = np.array([smallest(comm, (points[:, a] - size / 2).min(initial=np.inf)) for a in across])
    upper = np.array([largest(comm, (points[:, a] + size / 2).max(initial=-np.inf)) for a in across])
    least = smallest(comm, size.min(initial=np.inf))
    sides = np.clip(np.rint((upper - lower) / least) * _FINE, 1, _MOST_PIXELS[len(across)]).astype(np.int64)
    pixel = (upper - lower) / sides
    shadow = np.zeros((sides[0], sides[1] if dim == 3 else 1), np.uint8)
    places = np.ascontiguousarray(points[:, across])
    _paint(places, size, lower, pixel, shadow)
    join_marks(comm, shadow)
    return int(shadow.sum(dtype=np.int64)) * float(np.prod(pixel)) * thickness / exact_sum(comm, volume)


@kernel
def _paint(places, size, lower, pixel, shadow):
    """Set the pixels of shadow (n, m) whose centres lie in the squares of sides size (n,) around places (n, 1 or 2), m."""
    first, last = np.zeros(2, np.int64), np.zeros(2, np.int64)
    last[1] = 1
    for i in range(len(places)):
        for a in range(places.shape[1]):
            at = (places[i, a] - lower[a]) / pixel[a] - 0.5
            half = 0.5 * size[i] / pixel[a] + 1e-6
            first[a] = max(0, np.int64(np.ceil(at - half)))
            last[a] = min(shadow.shape[a], np.int64(np.floor(at + half)) + 1)
        for x in range(first[0], last[0]):
            for y in range(first[1], last[1]):
                shadow[x, y] = 1
