"""Pre-cracks: surfaces that cut the bonds crossing them (kernels/bond_states.py does the cutting)."""
from typing import NamedTuple

import numpy as np


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
    return [Facet(np.asarray(corner, float), normal / np.linalg.norm(normal), np.ascontiguousarray(np.linalg.pinv(edges).T), 0.0)]


def disk(center, normal, radius):
    """Return the Facet of a flat disk (3D), m."""
    normal = np.asarray(normal, dtype=float)
    return [Facet(np.asarray(center, float), normal / np.linalg.norm(normal), np.zeros((2, 3)), float(radius))]
