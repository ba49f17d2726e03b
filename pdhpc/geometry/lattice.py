"""Bodies filled with a square or cubic lattice; any rank can make any part of one without the rest."""
from dataclasses import dataclass
from typing import Tuple

import numpy as np

_SLAB_POINTS = 1 << 18  # points tested against the shape at once: bounds the temporary memory of set-up
_ON_LATTICE = 1e-6  # of a spacing: how closely bodies must lie on one lattice to count as doing so


@dataclass(frozen=True)
class LatticeBody:
    """A shape filled with cells of side `spacing`, one particle at the centre of each cell whose centre lies in the shape and in none of its holes.

    The lattice is anchored at the lower corner of the shape's bounding box. Ids count the cells of that box, last axis fastest, from `first_id`: they
    are unique and ordered, and not contiguous where cells are left out.
    """

    shape: object
    spacing: float
    first_id: int
    holes: Tuple[object, ...] = ()

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
        return np.concatenate([ids for ids, _ in pieces]), np.concatenate([points for _, points in pieces])

    def slabs_in(self, lower, upper):
        """Yield (ids, points) of points_in in pieces of bounded size, in order. Local."""
        ranges, coordinates = self.cells_in(lower, upper), []
        for axis, (first, last) in enumerate(ranges):
            coordinates.append(self.centres(axis)[first:last])
        layer = int(np.prod([len(c) for c in coordinates[1:]]))
        slab = max(1, _SLAB_POINTS // max(layer, 1))
        for first in range(0, len(coordinates[0]), slab):
            yield self._slab(ranges, coordinates, first, min(first + slab, len(coordinates[0])))

    def cells_in(self, lower, upper):
        """Return [(first, last)] along each axis of the cells whose centres have lower <= x < upper."""
        found = [np.searchsorted(self.centres(axis), [lower[axis], upper[axis]], side="left") for axis in range(len(self.cells))]
        return [(int(first), int(last)) for first, last in found]

    def cell_of(self, ids):
        """Return (n, dim) int64, the cells of ids (n,)."""
        return np.stack(np.unravel_index(ids - self.first_id, tuple(self.cells)), axis=1)

    def _slab(self, ranges, coordinates, first, last):
        """Return (ids, points) of the layers first..last-1 of the first axis."""
        axes = [coordinates[0][first:last]] + coordinates[1:]
        indices = [np.arange(start, stop, dtype=np.int64) for start, stop in [(ranges[0][0] + first, ranges[0][0] + last)] + ranges[1:]]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        ids = np.zeros((1,) * len(axes), dtype=np.int64)
        for axis, index in enumerate(indices):
            shape = [1] * len(axes)
            shape[axis] = -1
            ids = ids * self.cells[axis] + index.reshape(shape)
        keep = self.shape.contains(points)
        for hole in self.holes:
            keep &= ~hole.contains(points)
        return ids.ravel()[keep] + self.first_id, points[keep]

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
        offset = (body.bounds()[0] - origin) / spacing
        shift = np.rint(offset)
        axis = int(np.argmax(np.abs(offset - shift)))
        if abs(offset - shift)[axis] > _ON_LATTICE:
            return None, f"body {number + 1} lies {offset[axis] - shift[axis]:+.3f} spacings along {'xyz'[axis]} off the lattice of body 1"
        shifts.append(shift.astype(np.int64))
    return CommonLattice(np.asarray(origin, float), spacing, tuple(shifts)), None
