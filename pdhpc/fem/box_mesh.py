"""Boxes of quads or hexahedra: every rank works out its own cells and one layer around them, without messages and without anything global."""
from itertools import product
from typing import NamedTuple

import numpy as np

from pdhpc.fem.facets import UNIT_CORNERS
from pdhpc.fem.share import Share, order_owned_first
from pdhpc.parallel.partition import bisect

_PIECE = 1 << 18  # cells whose centres are looked at together: bounds the temporary memory
_SAMPLE = 100_000  # cells per rank that the partition of a large box is computed from


class Box(NamedTuple):
    """A box cut into equal cells; cells and vertices are numbered lexicographically, the last axis fastest.

    lower, upper : (dim,), m. counts : (dim,) cells along each axis.
    """

    lower: np.ndarray
    upper: np.ndarray
    counts: np.ndarray

    @classmethod
    def of(cls, lower, upper, counts):
        """Return a Box, after a check of its numbers.

        Raises
        ------
        ValueError: not two or three axes, a side that is not above 0, no cell along an axis.
        """
        lower, upper, counts = np.asarray(lower, float), np.asarray(upper, float), np.asarray(counts, np.int64)
        if not (lower.shape == upper.shape == counts.shape and lower.shape in ((2,), (3,))):
            raise ValueError(f"a box of cells has 2 or 3 numbers each for lower, upper and counts, not {lower.size}, {upper.size} and {counts.size}")
        if not (np.isfinite(lower).all() and np.isfinite(upper).all() and (upper > lower).all()):
            raise ValueError(f"a box of cells has its upper corner above the lower one, not {upper.tolist()} above {lower.tolist()}")
        if (counts < 1).any():
            raise ValueError(f"a box has at least one cell along each axis, not {counts.tolist()}")
        return cls(lower, upper, counts)

    @property
    def cell_size(self):
        """(dim,), m."""
        return (self.upper - self.lower) / self.counts

    def centres(self, axis):
        """Return (counts[axis],), m, the coordinates of the cells' centres along an axis. Local."""
        return self.lower[axis] + (self.upper[axis] - self.lower[axis]) * ((np.arange(self.counts[axis]) + 0.5) / self.counts[axis])

    def planes(self, axis):
        """Return (counts[axis] + 1,), m, the coordinates of the vertices along an axis. Local."""
        return self.lower[axis] + (self.upper[axis] - self.lower[axis]) * (np.arange(self.counts[axis] + 1) / self.counts[axis])

    def layer_side(self, axis, coordinate, after):
        """Return the plane, m, before the layer of cells around `coordinate`, or, where `after`, the one behind it. Local."""
        layer = np.floor((coordinate - self.lower[axis]) / self.cell_size[axis]) + bool(after)
        return self.planes(axis)[int(np.clip(layer, 0, self.counts[axis]))]


def cell_partition(comm, lower, upper, counts, weight=None):
    """Return the Partition of a box of cells into ranks of nearly equal work, cut between layers of cells. Collective.

    Each rank looks at an equal share of the cells, at _SAMPLE of them drawn evenly when there are more.

    Parameters
    ----------
    lower, upper : (dim,), m. counts : (dim,) cells along each axis.
    weight : None, or function centres (n, dim), m -> (n,) int, work of each cell.

    Raises
    ------
    ValueError: as Box.of.
    """
    box = Box.of(lower, upper, counts)
    total = int(np.prod(box.counts, dtype=object))
    first, last = (total * number // comm.size for number in (comm.rank, comm.rank + 1))
    interval = max(1, -(-total // (comm.size * _SAMPLE)))
    drawn = np.arange(first, last, interval)
    drawn = drawn + ((drawn * 2654435761 >> 12) % interval)
    index = np.unravel_index(drawn[drawn < last], tuple(box.counts))
    points = np.stack([box.centres(axis)[index[axis]] for axis in range(len(box.counts))], axis=1)
    weights = np.ones(len(points), np.int64) if weight is None else np.asarray(weight(points), np.int64)
    return bisect(comm, points, weights, box.layer_side)


def take_box_share(box, partition, rank, keep=None):
    """Return the Share of a rank: its own cells and those that share a vertex with one of them. Local.

    Who owns their vertices depends on cells two layers away at most, so only these are looked at.

    Parameters
    ----------
    box : Box. partition : Partition. keep : None, or function centres (n, dim), m -> (n,) bool, False where there is no cell.
    """
    dim = len(box.counts)
    centres = [box.centres(axis) for axis in range(dim)]
    low, high = partition.box(rank, dim)
    first = np.array([np.searchsorted(centres[axis], low[axis]) for axis in range(dim)])
    last = np.array([np.searchsorted(centres[axis], high[axis]) for axis in range(dim)])
    last = np.where((last > first).all(), last, first)
    start, end = (np.maximum(first - 2, 0), np.minimum(last + 2, box.counts)) if (last > first).all() else (first, first)
    window = _Window(start, end - start, tuple(slice(a, b) for a, b in zip(first - start, last - start)))
    kept = _find_kept([x[a:b] for x, a, b in zip(centres, start, end)], keep)
    cell_owner = _find_owners(window, centres, kept, partition, rank)
    cells, vertex_mark = _choose_cells(window, kept)
    vertex_owner = _find_vertex_owners(window, kept, cell_owner)
    return _number(box, window, rank, cells, cell_owner.ravel()[cells], np.where(vertex_mark, vertex_owner, -1))


class _Window(NamedTuple):
    """The cells near a rank's own: start, shape (dim,) in cells, owned: slices of its own within."""

    start: np.ndarray
    shape: np.ndarray
    owned: tuple

    def corners(self):
        """Return slices of a window of vertices (shape + 1), for each of the corners of all cells, from the lowest to the highest."""
        return [tuple(slice(offset, offset + n) for offset, n in zip(corner, self.shape)) for corner in product((0, 1), repeat=len(self.shape))]

    def index(self, flat, more=0):
        """Return [index along each axis of the box] of cells, or with more = 1 of vertices, of this window. Local."""
        return [along + start for along, start in zip(np.unravel_index(flat, tuple(self.shape + more)), self.start)]


def _find_kept(centres, keep):
    """Return bool array over a window of cells with `centres` along each axis: which there are."""
    shape = tuple(len(along) for along in centres)
    if keep is None or 0 in shape:
        return np.ones(shape, np.bool_)
    kept = np.empty(shape, np.bool_)
    rows = max(1, _PIECE // max(1, int(np.prod(shape[1:]))))
    for row in range(0, shape[0], rows):
        points = np.stack(np.meshgrid(centres[0][row : row + rows], *centres[1:], indexing="ij"), axis=-1)
        kept[row : row + rows] = np.asarray(keep(points.reshape(-1, len(shape))), np.bool_).reshape(points.shape[:-1])
    return kept


def _find_owners(window, centres, kept, partition, rank):
    """Return int32 array over the window: the owner of each cell that there is."""
    owner = np.full(kept.shape, rank, np.int32)
    foreign = kept.copy()
    foreign[window.owned] = False
    flat = np.flatnonzero(foreign)
    points = np.stack([along[index] for along, index in zip(centres, window.index(flat))], axis=1)
    owner.ravel()[flat] = partition.owner(points)
    return owner


def _choose_cells(window, kept):
    """Return (cells, mark): flat indices of owned cells and of those that share a vertex with one, and bool over vertices, which belong to any of them."""
    owned = np.zeros(kept.shape, np.bool_)
    owned[window.owned] = kept[window.owned]
    mark, near = np.zeros(tuple(window.shape + 1), np.bool_), np.zeros(kept.shape, np.bool_)
    for corner in window.corners():
        mark[corner] |= owned
    for corner in window.corners():
        near |= mark[corner]
    near &= kept
    for corner in window.corners():
        mark[corner] |= near
    return np.flatnonzero(near), mark


def _find_vertex_owners(window, kept, cell_owner):
    """Return int32 array over vertices: the owner of the cell with the smallest id around each, -1 without any."""
    owner = np.full(tuple(window.shape + 1), -1, np.int32)
    for corner in window.corners():  # the cell of which a vertex is the highest corner has the smallest id: it comes last
        owner[corner] = np.where(kept, cell_owner, owner[corner])
    return owner


def _number(box, window, rank, cells, cell_owner, vertex_owner):
    """Return the Share of the window's `cells` (n,) and of the vertices whose owner is not -1."""
    kind = {2: "quad", 3: "hexahedron"}[len(box.counts)]
    cell_id = np.ravel_multi_index(window.index(cells), tuple(box.counts))
    order, n_owned_cells = order_owned_first(cell_owner, cell_id, rank)
    cells, cell_id, cell_owner = cells[order], cell_id[order], cell_owner[order][n_owned_cells:]
    vertices = np.flatnonzero(vertex_owner.ravel() >= 0)
    owner = vertex_owner.ravel()[vertices]
    order, n_owned = order_owned_first(owner, vertices, rank)  # the window's order is that of ids
    vertices, owner = vertices[order], owner[order]
    number = np.empty(vertex_owner.size, np.int32)
    number[vertices] = np.arange(len(vertices), dtype=np.int32)
    shape = vertex_owner.shape
    lowest = np.ravel_multi_index(np.unravel_index(cells, tuple(window.shape)), shape) if len(cells) else cells
    corners = np.empty((len(cells), len(UNIT_CORNERS[kind])), np.int32)
    for corner, offset in enumerate(np.ravel_multi_index(UNIT_CORNERS[kind].T, shape) if len(cells) else ()):
        corners[:, corner] = number[lowest + offset]
    index = window.index(vertices, 1)
    points = np.stack([box.planes(axis)[index[axis]] for axis in range(len(shape))], axis=1)
    vertex_id = np.ravel_multi_index(index, tuple(box.counts + 1))
    return Share(kind, corners, cell_id.astype(np.int64), cell_owner.astype(np.int64), points, vertex_id.astype(np.int64), owner[n_owned:].astype(np.int64))
