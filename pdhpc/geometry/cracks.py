"""Pre-cracks: surfaces that cut the bonds crossing them.

A bond is cut when its ends lie on different sides of the crack's line or plane and the crossing point lies on the crack. A point on the line or plane
itself counts as lying on its positive side, so that a crack along a row of particles still separates the body in two.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import kernel

_EDGE = 1e-9  # relative: a crossing point this far outside the rim still counts as on the crack


class Facet(NamedTuple):
    """One flat piece of a crack: a segment (2D), a parallelogram or a disk (3D).

    The crossing point p lies on the piece when 0 <= (p - origin).along[k] <= 1 for the rows of `along`, or, with radius > 0, when |p - origin| <= radius.
    """

    origin: np.ndarray  # (dim,) m
    normal: np.ndarray  # (dim,) unit
    along: np.ndarray  # (dim - 1, dim) 1/m: dual vectors of the edges
    radius: float  # m; 0 unless a disk


def polyline(points):
    """Return one Facet per segment of a 2D polyline (n, 2), m."""
    points = np.asarray(points, dtype=float)
    facets = []
    for start, end in zip(points[:-1], points[1:]):
        edge = end - start
        normal = np.array([-edge[1], edge[0]]) / np.linalg.norm(edge)
        facets.append(Facet(start, normal, (edge / (edge @ edge))[None, :], 0.0))
    return facets


def rectangle(corner, edge1, edge2):
    """Return the Facet of the parallelogram spanned by two edges from a corner (3D), m."""
    edges = np.array([edge1, edge2], dtype=float)
    normal = np.cross(edges[0], edges[1])
    return [Facet(np.asarray(corner, float), normal / np.linalg.norm(normal), np.linalg.pinv(edges).T, 0.0)]


def disk(center, normal, radius):
    """Return the Facet of a flat disk (3D), m."""
    normal = np.asarray(normal, dtype=float)
    return [Facet(np.asarray(center, float), normal / np.linalg.norm(normal), np.zeros((2, 3)), float(radius))]


def cut_bonds(bonds, points, n_owned, facets):
    """Clear the alive bit of every bond that crosses one of `facets`; return how many directed bonds of this rank were cut. Local.

    Parameters
    ----------
    bonds : BondArrays of the owned particles. points : (n_owned + n_ghost, dim), m, reference positions.
    """
    return sum(_cut(bonds.row_start, bonds.neighbour, bonds.alive, points, n_owned, *facet) for facet in facets)


@kernel
def _cut(row_start, neighbour, alive, points, n_owned, origin, normal, along, radius):
    dim = points.shape[1]
    cut = 0
    for i in range(n_owned):
        side_i = 0.0
        for d in range(dim):
            side_i += (points[i, d] - origin[d]) * normal[d]
        for k in range(row_start[i], row_start[i + 1]):
            bit = np.uint8(1 << (k & 7))
            if not alive[k >> 3] & bit:
                continue
            j = neighbour[k]
            side_j = 0.0
            for d in range(dim):
                side_j += (points[j, d] - origin[d]) * normal[d]
            if (side_i >= 0.0) == (side_j >= 0.0):
                continue
            fraction = side_i / (side_i - side_j)
            if _on_piece(points, i, j, fraction, origin, along, radius):
                alive[k >> 3] &= ~bit
                cut += 1
    return cut


@kernel
def _on_piece(points, i, j, fraction, origin, along, radius):
    """Whether the point at `fraction` of the bond from i to j lies within the rim of the piece."""
    dim = points.shape[1]
    if radius > 0.0:
        distance2 = 0.0
        for d in range(dim):
            offset = points[i, d] + fraction * (points[j, d] - points[i, d]) - origin[d]
            distance2 += offset * offset
        return distance2 <= (radius * (1.0 + _EDGE)) ** 2
    for e in range(dim - 1):
        coordinate = 0.0
        for d in range(dim):
            coordinate += (points[i, d] + fraction * (points[j, d] - points[i, d]) - origin[d]) * along[e, d]
        if coordinate < -_EDGE or coordinate > 1.0 + _EDGE:
            return False
    return True
