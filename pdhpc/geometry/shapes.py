"""Shapes that say which points they contain, boundaries included, and how far away points are: distance(points) is 0 inside."""
from dataclasses import dataclass
from typing import Tuple

import numpy as np

_SAME = 1e-6  # of a spacing
_PIECE = 1 << 18  # points tested at once: bounds the temporary memory
_ON_BOUNDARY = 1e-9  # relative to the size of the shape: points that round-off moved off its boundary still belong to it


@dataclass(frozen=True)
class Box:
    """Axis-aligned box lower <= x <= upper, m."""

    lower: Tuple[float, ...]
    upper: Tuple[float, ...]

    def contains(self, points):
        """Return (n,) bool for points (n, dim), m."""
        lower, upper = np.asarray(self.lower), np.asarray(self.upper)
        slack = _ON_BOUNDARY * np.max(upper - lower)
        return np.all((points >= lower - slack) & (points <= upper + slack), axis=1)

    def distance(self, points):
        """Return (n,) m."""
        return np.linalg.norm(np.maximum(0.0, np.maximum(np.asarray(self.lower) - points, points - np.asarray(self.upper))), axis=1)

    def bounds(self):
        """Return (lower, upper), m."""
        return np.asarray(self.lower, float), np.asarray(self.upper, float)


@dataclass(frozen=True)
class Disk:
    """Disk |x - center| <= radius in 2D, m."""

    center: Tuple[float, ...]
    radius: float

    def contains(self, points):
        """Return (n,) bool for points (n, dim), m."""
        distance = np.linalg.norm(points - np.asarray(self.center), axis=1)
        return distance <= self.radius * (1 + _ON_BOUNDARY)

    def distance(self, points):
        """Return (n,) m."""
        return np.maximum(0.0, np.linalg.norm(points - np.asarray(self.center), axis=1) - self.radius)

    def bounds(self):
        """Return (lower, upper), m."""
        center = np.asarray(self.center, float)
        return center - self.radius, center + self.radius


class Sphere(Disk):
    """Ball |x - center| <= radius in 3D, m."""


@dataclass(frozen=True)
class Cylinder:
    """Cylinder around the segment start-end, m, with flat ends; hollow with an inner_radius above 0."""

    start: Tuple[float, float, float]
    end: Tuple[float, float, float]
    radius: float
    inner_radius: float = 0.0

    def contains(self, points):
        """Return (n,) bool for points (n, 3), m."""
        along, across, length = self._coordinates(points)
        slack = _ON_BOUNDARY * max(length, self.radius)
        return (along >= -slack) & (along <= length + slack) & (across <= self.radius + slack) & (across >= self.inner_radius - slack)

    def distance(self, points):
        """Return (n,) m."""
        along, across, length = self._coordinates(points)
        return np.hypot(np.maximum(0.0, np.maximum(-along, along - length)), np.maximum(0.0, np.maximum(across - self.radius, self.inner_radius - across)))

    def _coordinates(self, points):
        """Return (along the axis from its start, distance from the axis, length of the axis), m."""
        start = np.asarray(self.start, float)
        axis = np.asarray(self.end, float) - start
        length = np.linalg.norm(axis)
        offset = points - start
        along = offset @ (axis / length)
        return along, np.linalg.norm(offset - along[:, None] * (axis / length), axis=1), length

    def bounds(self):
        """Return (lower, upper), m."""
        start, end = np.asarray(self.start, float), np.asarray(self.end, float)
        direction = (end - start) / np.linalg.norm(end - start)
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - direction**2))
        return np.minimum(start, end) - reach, np.maximum(start, end) + reach


@dataclass(frozen=True)
class HalfSpace:
    """Points on the side that `normal` points to: (x - point) . normal >= 0."""

    point: Tuple[float, ...]
    normal: Tuple[float, ...]

    def contains(self, points):
        """Return (n,) bool for points (n, dim), m."""
        normal = np.asarray(self.normal, float)
        offset = points - np.asarray(self.point)
        return offset @ (normal / np.linalg.norm(normal)) >= -_ON_BOUNDARY * np.max(np.abs(offset), initial=0.0)

    def distance(self, points):
        """Return (n,) m."""
        normal = np.asarray(self.normal, float)
        return np.maximum(0.0, (np.asarray(self.point) - points) @ (normal / np.linalg.norm(normal)))

    def bounds(self):
        """Return (lower, upper), m: infinite."""
        dim = len(self.point)
        return np.full(dim, -np.inf), np.full(dim, np.inf)


@dataclass(frozen=True)
class Everywhere:
    """All of space."""

    dim: int

    def contains(self, points):
        """Return (n,) bool, all true."""
        return np.ones(len(points), dtype=bool)

    def distance(self, points):
        """Return (n,) m, all 0."""
        return np.zeros(len(points))

    def bounds(self):
        """Return (lower, upper), m: infinite."""
        return np.full(self.dim, -np.inf), np.full(self.dim, np.inf)


@dataclass(frozen=True)
class Band:
    """Points within `radius` of a polyline, m."""

    points: Tuple[Tuple[float, ...], ...]
    radius: float

    def contains(self, points):
        """Return (n,) bool for points (n, dim), m."""
        return self._from_line(points) <= self.radius * (1 + _ON_BOUNDARY)

    def distance(self, points):
        """Return (n,) m."""
        return np.maximum(0.0, self._from_line(points) - self.radius)

    def _from_line(self, points):
        """Return (n,) distances from the polyline, m."""
        nearest = np.full(len(points), np.inf)
        for start, end in zip(np.asarray(self.points[:-1], float), np.asarray(self.points[1:], float)):
            side = end - start
            along = np.clip((points - start) @ side / (side @ side), 0.0, 1.0)
            nearest = np.minimum(nearest, np.linalg.norm(points - start - along[:, None] * side, axis=1))
        return nearest

    def bounds(self):
        """Return (lower, upper), m."""
        corners = np.asarray(self.points, float)
        return corners.min(axis=0) - self.radius, corners.max(axis=0) + self.radius


@dataclass(frozen=True)
class Within:
    """Points at most `width` away from a shape, m."""

    shape: object
    width: float

    def contains(self, points):
        """Return (n,) bool for points (n, dim), m."""
        return self.shape.distance(points) <= self.width

    def bounds(self):
        """Return (lower, upper), m."""
        lower, upper = self.shape.bounds()
        return lower - self.width, upper + self.width


@dataclass(frozen=True)
class Bonded:
    """A shape, and the points of a lattice that may be bonded to one in it: the smallest overlap that leaves no bond across, a layer less than `Within` often is.

    spacing, m; stencil : (n, dim) int, the neighbours of a lattice point up to `width`, m.
    """

    shape: object
    width: float
    spacing: float
    stencil: np.ndarray

    def contains(self, points):
        """Return (n,) bool for lattice points (n, dim), m; a neighbour within 1e-6 spacings of the shape counts as in it."""
        distance = self.shape.distance(points)
        inside = distance <= self.width
        unsure = np.flatnonzero(inside & (distance > self.width - self.spacing))
        for piece in np.array_split(unsure, max(1, len(unsure) * len(self.stencil) // _PIECE)):
            near = (points[piece][:, None, :] + self.stencil * self.spacing).reshape(-1, points.shape[1])
            inside[piece] = (self.shape.distance(near).reshape(len(piece), len(self.stencil)) <= _SAME * self.spacing).any(axis=1)
        return inside

    def bounds(self):
        """Return (lower, upper), m."""
        lower, upper = self.shape.bounds()
        return lower - self.width, upper + self.width


@dataclass(frozen=True)
class Beyond:
    """Points more than `width` away from a shape, m."""

    shape: object
    width: float

    def contains(self, points):
        """Return (n,) bool for points (n, dim), m."""
        return self.shape.distance(points) > self.width

    def bounds(self):
        """Return (lower, upper), m: infinite."""
        lower, _ = self.shape.bounds()
        return np.full(len(lower), -np.inf), np.full(len(lower), np.inf)
