"""Bodies made of given points, each with its volume, spread over ranks; beside the lattices of lattice.py, with the same face."""
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class PointBody:
    """The points of one body that this rank holds: at first an equal piece of them all, later those in reach of its box.

    Ids are first_id plus the number of the point's row in its file; a body of some rows has gaps between them. Memory per point held 8 dim + 24 bytes.

    Attributes
    ----------
    first_id, last_id : its ids lie in first_id ... last_id - 1. count : points of the whole body.
    id (n,) int64, ascending; points (n, dim), m; volume (n,), m^3; marks (n,) uint64 : bit k is set for members of group k of the file.
    lower, upper : (dim,) m, of the whole body. sizes : (smallest, mean, largest), m, sides of squares or cubes of the points' volumes.
    window : None, or a shape: only the points in it.
    """

    first_id: int
    last_id: int
    count: int
    id: np.ndarray
    points: np.ndarray
    volume: np.ndarray
    marks: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    sizes: tuple
    window: object = None

    @property
    def spacing(self):
        """Mean size of a particle, m."""
        return self.sizes[1]

    def bounds(self):
        """Return (lower, upper), m."""
        return self.lower, self.upper

    def points_in(self, lower, upper):
        """Return (ids, points) of the points held with lower <= x < upper, in the window, ascending in id. Local."""
        inside = np.all((self.points >= lower) & (self.points < upper), axis=1)
        if self.window is not None:
            inside[inside] = self.window.contains(self.points[inside])
        return self.id[inside], self.points[inside]

    def rows_of(self, ids):
        """Return (n,) int64: the rows of points by id, -1 for those not held. Local."""
        if not len(self.id):
            return np.full(len(ids), -1)
        row = np.minimum(np.searchsorted(self.id, ids), len(self.id) - 1)
        return np.where(self.id[row] == ids, row, -1)
