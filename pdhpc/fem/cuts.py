"""Quadrature over the part of cells or facets that lies within a convex shape.

Exact for boxes and half spaces along the axes on lines, rectangles and cuboids that stand along the axes too. Other parts are sampled: by 512 points of a
low-discrepancy sequence in the box of reference coordinates that the shape's bounds leave; the error of the measure is about 1 % of that box, at most 3 %.
"""
import numpy as np

from pdhpc.geometry.shapes import Box, HalfSpace

_SAMPLES = 512  # of each cut cell or facet
_TOGETHER = 1 << 14  # points looked at together: bounds the temporary memory
_ROUNDS = 16  # in which a quarter is cut off each end of the box that samples lie in, where the shape does not reach
_SAME = 1e-9  # of a size: what lies closer to a boundary lies on it
_LEAST = 1e-6  # of a cell's side: a part thinner than this is none


def parts(element, corners, shape, rule, kinks):
    """Yield (chosen (n,), points (n or 1, q, d), weights (n or 1, q)): quadrature, in reference coordinates, of what is within a shape. Local.

    element : Element of dimension d. corners (n_elements, corners, dim), m. shape : convex, as in geometry.shapes, or None: all of space.
    rule : (points, weights) of a whole element. kinks : reference coordinates along an axis between which functions are polynomials up to degree 3.
    """
    whole = np.ones(len(corners), bool) if shape is None else _contains(shape, corners).all(axis=1)
    yield from _pieces(np.flatnonzero(whole), len(rule[1]), lambda chosen: (rule[0][None], rule[1][None]))
    if whole.all():
        return
    lower, upper = shape.bounds()
    slack = _SAME * np.ptp(corners, axis=1).max(axis=1, initial=0.0)[:, None]
    cut = np.flatnonzero(~whole & ((corners.min(axis=1) <= upper + slack) & (corners.max(axis=1) >= lower - slack)).all(axis=1))
    sides = _sides_of(shape)
    straight = np.zeros(len(cut), bool) if sides is None or element.simplex else _is_straight(element, corners[cut])
    if straight.any():
        chosen, low, high = _overlap(element, corners, cut[straight], *sides)
        order = 2 * (len(kinks) - 1)
        yield from _pieces(chosen, order**element.dim, lambda some: _gauss(low[some], high[some], np.asarray(kinks)), True)
    rest = cut[~straight]
    yield from _pieces(rest, _SAMPLES, lambda some: _sampled(element, corners[rest[some]], shape), True)


def _pieces(chosen, size, make, by_place=False):
    """Yield (chosen, points, weights) of a few elements at a time; make : of their numbers, or their places among the chosen."""
    step = max(1, _TOGETHER // size)
    for first in range(0, len(chosen), step):
        some = slice(first, first + step)
        yield (chosen[some], *make(some if by_place else chosen[some]))


def _contains(shape, places):
    """Return (..., ) bool of places (..., dim), m."""
    return shape.contains(places.reshape(-1, places.shape[-1])).reshape(places.shape[:-1])


def _sides_of(shape):
    """Return (lower, upper), m, of a box, or of a half space along an axis, infinite where there is none; None of other shapes."""
    if isinstance(shape, Box):
        return shape.bounds()
    if not isinstance(shape, HalfSpace) or np.count_nonzero(shape.normal) != 1:
        return None
    lower, upper = shape.bounds()
    axis = int(np.flatnonzero(shape.normal)[0])
    (lower if shape.normal[axis] > 0.0 else upper)[axis] = shape.point[axis]
    return lower, upper


def _edges(element, corners):
    """Return (n, dim, d), m: dx/dxi at the first corner, along the edges from it."""
    ends = [int(np.flatnonzero((element.places == axis).all(axis=1))[0]) for axis in np.eye(element.dim)]
    return np.stack([corners[:, end] - corners[:, 0] for end in ends], axis=2)


def _is_flat(element, corners):
    """Return (n,) bool: x is linear in xi."""
    edges = _edges(element, corners)
    bent = np.abs(corners[:, :1] + np.einsum("ck,nak->nca", element.places, edges) - corners).max(axis=(1, 2))
    return bent <= _SAME * np.abs(edges).max(axis=(1, 2))


def _is_straight(element, corners):
    """Return (n,) bool: x is linear in xi, and each of its components changes with one component of xi at most."""
    edges = np.abs(_edges(element, corners))
    others = np.sort(edges, axis=2)[:, :, :-1].max(axis=(1, 2), initial=0.0)
    return _is_flat(element, corners) & (others <= _SAME * edges.max(axis=(1, 2)))


def _overlap(element, corners, cut, lower, upper):
    """Return (chosen, low (n, d), high (n, d)): the straight elements of `cut`, whose bounds a box reaches, that reach into it, and from where to where in reference coordinates."""
    start, edges = corners[cut, 0], _edges(element, corners[cut])
    low, high = np.zeros((len(cut), element.dim)), np.ones((len(cut), element.dim))
    size, rows = np.abs(edges).max(axis=(1, 2)), np.arange(len(cut))
    for axis in range(start.shape[1]):
        along = np.abs(edges[:, axis]).argmax(axis=1)
        slope = edges[rows, axis, along]
        moves = np.abs(slope) > _SAME * size
        ends = np.stack([lower[axis] - start[:, axis], upper[axis] - start[:, axis]]) / np.where(moves, slope, 1.0)
        low[rows, along] = np.where(moves, np.maximum(low[rows, along], ends.min(axis=0)), low[rows, along])
        high[rows, along] = np.where(moves, np.minimum(high[rows, along], ends.max(axis=0)), high[rows, along])
    reached = (high - low > _LEAST).all(axis=1)
    return cut[reached], low[reached], high[reached]


def _gauss(low, high, kinks):
    """Return (points (n, q, d), weights (n, q)): two Gauss points along each axis of each box between kinks, in boxes from low to high (n, d)."""
    x, w = np.polynomial.legendre.leggauss(2)
    ends = np.clip(kinks, low[:, :, None], high[:, :, None])
    sides = np.diff(ends, axis=2)[..., None]
    points = (ends[:, :, :-1, None] + 0.5 * (x + 1.0) * sides).reshape(*low.shape, -1)
    weights = (0.5 * w * sides).reshape(*low.shape, -1)
    axes = np.arange(low.shape[1])
    number = np.stack(np.unravel_index(np.arange(points.shape[2] ** len(axes)), [points.shape[2]] * len(axes)), axis=1)
    return points[:, axes, number], weights[:, axes, number].prod(axis=2)


def _sampled(element, corners, shape):
    """Return (points (n, q, d), weights (n, q)): samples of elements, of weight 0 outside of the shape."""
    low, high = _reach(element, corners, *shape.bounds())
    points = low[:, None] + (high - low)[:, None] * _sequence(element.dim)
    inside = _contains(shape, _places(element, corners, points))
    if element.simplex:
        inside &= points.sum(axis=2) < 1.0
    return points, inside * ((high - low).prod(axis=1) / _SAMPLES)[:, None]


def _sequence(dim):
    """Return (q, dim) points spread evenly over the unit box: multiples of 1/phi, 1/phi^2, ..., phi^(dim + 1) = phi + 1, modulo 1."""
    phi = 2.0
    for _ in range(60):
        phi = (1.0 + phi) ** (1.0 / (dim + 1))
    return (0.5 + np.arange(1, _SAMPLES + 1)[:, None] * phi ** -np.arange(1.0, dim + 1)) % 1.0


def _reach(element, corners, lower, upper):
    """Return (low (n, d), high (n, d)): boxes of reference coordinates outside of which no point of an element lies between bounds lower and upper, m."""
    low, high = np.zeros((len(corners), element.dim)), np.ones((len(corners), element.dim))
    unit, flat = _unit_corners(element.dim), np.zeros(len(corners), bool)
    if element.dim == corners.shape[2]:
        flat = _is_flat(element, corners)
        low[flat], high[flat] = _reach_of_flat(element, corners[flat], lower, upper)
    for _ in range(0 if flat.all() else _ROUNDS):
        for axis in range(element.dim):
            for near, far in ((low, high), (high, low)):
                ends = [low.copy(), high.copy()]
                moved = near[:, axis] + 0.25 * (far[:, axis] - near[:, axis])
                ends[int(near is low)][:, axis] = moved
                places = _places(element, corners, ends[0][:, None] + unit * (ends[1] - ends[0])[:, None])
                beyond = ((places.min(axis=1) > upper) | (places.max(axis=1) < lower)).any(axis=1)
                near[beyond & ~flat, axis] = moved[beyond & ~flat]
    return low, high


def _reach_of_flat(element, corners, lower, upper):
    """Return (low, high) as _reach of elements with x linear in xi: the reference coordinates of the box that bounds have in common with the element's. Local."""
    lowest, highest = corners.min(axis=1), corners.max(axis=1)
    least = np.clip(lower, lowest, highest)
    box = least[:, None] + _unit_corners(element.dim) * (np.clip(upper, lowest, highest) - least)[:, None]
    xi = np.linalg.solve(_edges(element, corners), (box - corners[:, :1]).transpose(0, 2, 1))
    return np.clip(xi.min(axis=2), 0.0, 1.0), np.clip(xi.max(axis=2), 0.0, 1.0)


def _unit_corners(dim):
    """Return (2^dim, dim): the corners of the unit box."""
    return np.stack(np.unravel_index(np.arange(2**dim), [2] * dim), axis=1).astype(float)


def _places(element, corners, points):
    """Return x (n, q, dim), m, at reference coordinates (n, q, d); each has the same bits whatever stands beside it."""
    functions = element.shape(points.reshape(-1, element.dim)).reshape(*points.shape[:2], element.corners)
    return sum(functions[:, :, corner, None] * corners[:, None, corner] for corner in range(element.corners))
