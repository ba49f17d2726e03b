"""Bodies filled with a square or cubic lattice; any rank can make any part of one without the rest."""
from dataclasses import dataclass
from typing import NamedTuple, Tuple

import numpy as np

_SLAB_POINTS = 1 << 18  # points tested against the shape at once: bounds the temporary memory of set-up
_ON_LATTICE = 1e-6  # of a spacing: how closely bodies must lie on one lattice to count as doing so


class Slab(NamedTuple):
    """Particles of a block of cells: ids (n,) int64; points (n, dim), m; ranges [(first, last)] of the cells; keep: which of these hold one, None for all."""

    ids: np.ndarray
    points: np.ndarray
    ranges: list
    keep: np.ndarray

    def number(self, steps, start):
        """Return (n,) int64: start + sum of steps[axis] times the particle's cell along each axis."""
        dim = len(self.ranges)
        numbers = np.full([last - first for first, last in self.ranges], start, np.int64)
        for axis, (first, last) in enumerate(self.ranges):
            numbers += _along(np.arange(first, last) * steps[axis], axis, dim)
        return self.kept(numbers)

    def within(self, first, last):
        """Return (n,) bool: which particles lie in cells first ... last - 1 along every axis."""
        dim = len(self.ranges)
        inside = np.ones([b - a for a, b in self.ranges], bool)
        for axis, (a, b) in enumerate(self.ranges):
            cells = np.arange(a, b)
            inside &= _along((cells >= first[axis]) & (cells < last[axis]), axis, dim)
        return self.kept(inside)

    def kept(self, values):
        """Return values of the block's cells as those of its particles."""
        return values.ravel() if self.keep is None else values.ravel()[self.keep]


def _along(values, axis, dim):
    """Return values (n,) shaped to lie along one of `dim` axes."""
    shape = [1] * dim
    shape[axis] = -1
    return values.reshape(shape)


@dataclass(frozen=True)
class LatticeBody:
    """A shape filled with cells of side `spacing`, one particle at the centre of each cell whose centre lies in the shape and in none of its holes.

    The lattice is anchored at the lower corner of the shape's bounding box, whatever the window. Ids count the cells of that box, last axis fastest, from `first_id`: they
    are unique and ordered, and not contiguous where cells are left out.
    """

    shape: object
    spacing: float
    first_id: int
    holes: Tuple[object, ...] = ()
    window: object = None  # a shape: only the particles in it; ids stay those of the whole body

    @property
    def cells(self):
        """Number of cells of the bounding box along each axis."""
        lower, upper = self.shape.bounds()
        return np.maximum(1, np.ceil((upper - lower) / self.spacing - 1e-6)).astype(np.int64)

    @property
    def last_id(self):
        """One past the largest id this body can hold."""
        return self.first_id + int(np.prod(self.cells, dtype=object))

    def centres(self, axis):
        """Return every coordinate of the lattice along one axis, m: the same bits whoever asks."""
        return self.shape.bounds()[0][axis] + (np.arange(self.cells[axis]) + 0.5) * self.spacing

    def points_in(self, lower, upper):
        """Return (ids, points) with lower <= x < upper, ascending in id. Local.

        Returns
        -------
        ids : (n,) int64; points : (n, dim) float, m.
        """
        pieces = list(self.slabs_in(lower, upper))
        if not pieces:
            return np.empty(0, np.int64), np.empty((0, len(self.cells)))
        return np.concatenate([slab.ids for slab in pieces]), np.concatenate([slab.points for slab in pieces])

    def slabs_in(self, lower, upper):
        """Yield the Slabs of points_in, pieces of bounded size, in order. Local."""
        ranges = self.cells_in(lower, upper)
        layer = int(np.prod([last - first for first, last in ranges[1:]]))
        thickness = max(1, _SLAB_POINTS // max(layer, 1))
        for first in range(*ranges[0], thickness):
            yield self._slab([(first, min(first + thickness, ranges[0][1]))] + ranges[1:])

    def window_cells(self):
        """Return (first, last), (dim,) int64 both: the cells of the box around the window."""
        everywhere = np.full(len(self.cells), np.inf)
        first, last = np.array(self.cells_in(-everywhere, everywhere), dtype=np.int64).T
        return first, last

    def cells_in(self, lower, upper):
        """Return [(first, last)] along each axis of the cells whose centres have lower <= x < upper."""
        found = [np.searchsorted(self.centres(axis), [lower[axis], upper[axis]], side="left") for axis in range(len(self.cells))]
        if self.window is not None:
            inner, outer = self.window.bounds()
            seen = [np.searchsorted(self.centres(a), [inner[a], outer[a]], side="left") + [-1, 1] for a in range(len(self.cells))]
            found = [(max(a, c), max(max(a, c), min(b, d))) for (a, b), (c, d) in zip(found, seen)]
        return [(int(first), int(last)) for first, last in found]

    def _slab(self, ranges):
        """Return the Slab of a block of cells."""
        dim = len(ranges)
        points = np.empty([last - first for first, last in ranges] + [dim])
        for axis, (first, last) in enumerate(ranges):
            points[..., axis] = _along(self.centres(axis)[first:last], axis, dim)
        points = points.reshape(-1, dim)
        keep = self.contains(points)
        steps = np.concatenate([np.cumprod(self.cells[:0:-1])[::-1], [1]])
        slab = Slab(None, points if keep.all() else points[keep], ranges, None if keep.all() else keep)
        return slab._replace(ids=slab.number(steps, self.first_id))

    def contains(self, points):
        """Return (n,) bool, which of the cell centres `points` (n, dim), m, hold a particle: those in the shape and in none of its holes."""
        keep = self.shape.contains(points)
        for hole in self.holes:
            keep &= ~hole.contains(points)
        if self.window is not None:
            keep &= self.window.contains(points)
        return keep

    def bounds(self):
        """Return (lower, upper), m."""
        return self.shape.bounds()


def points_of_bodies(bodies, lower, upper):
    """Return (ids, points, body index) of all bodies in the half-open box, ascending in id. Local."""
    dim = len(lower)
    parts = [body.points_in(lower, upper) for body in bodies]
    owner = [np.full(len(ids), number, dtype=np.int32) for number, (ids, _) in enumerate(parts)]
    if not parts:
        return np.empty(0, np.int64), np.empty((0, dim)), np.empty(0, np.int32)
    return np.concatenate([ids for ids, _ in parts]), np.concatenate([points for _, points in parts]), np.concatenate(owner)


@dataclass(frozen=True)
class CommonLattice:
    """The lattice that all bodies lie on: cell c has its centre at origin + (c + 1/2) spacing, m; cell c of body b is cell c + shifts[b] of it."""

    origin: np.ndarray
    spacing: float
    shifts: Tuple[np.ndarray, ...]

    def centre(self, axis, first, last):
        """Return the coordinates of the cells first ... last - 1 along an axis, m: the same bits whoever asks."""
        return self.origin[axis] + (np.arange(first, last) + 0.5) * self.spacing

    def between(self, axis, coordinate, after):
        """Return the plane, m, between the layer of cells around `coordinate` and the one before it, or, where `after`, the one after it."""
        layer = np.floor((coordinate - self.origin[axis]) / self.spacing) + bool(after)
        return self.origin[axis] + layer * self.spacing


def find_common_lattice(bodies):
    """Return (CommonLattice, None), or (None, why the bodies share none)."""
    origin, spacing, shifts = bodies[0].bounds()[0], bodies[0].spacing, []
    for number, body in enumerate(bodies):
        if body.spacing != spacing:
            return None, f"body {number + 1} has a spacing of {body.spacing:g} m, body 1 of {spacing:g} m"
        offset = (body.bounds()[0] - origin) / spacing
        shift = np.rint(offset)
        axis = int(np.argmax(np.abs(offset - shift)))
        if abs(offset - shift)[axis] > _ON_LATTICE:
            return None, f"body {number + 1} lies {offset[axis] - shift[axis]:+.3f} spacings along {'xyz'[axis]} off the lattice of body 1"
        shifts.append(shift.astype(np.int64))
    return CommonLattice(np.asarray(origin, float), spacing, tuple(shifts)), None
