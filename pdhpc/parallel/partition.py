"""Weighted recursive coordinate bisection of points that are spread over ranks."""
from typing import NamedTuple

import numpy as np

_BINS = 256
_ROUNDS = 4
_SNAP = 0.02  # of a rank's work: how near borders of pieces of work are moved to borders of ranks


class Partition(NamedTuple):
    """A binary tree of axis-aligned cuts; its leaves are the ranks' boxes.

    A point belongs to the left child of a node when its coordinate along `axis` is below `cut`. Children >= 0 are nodes, child -(r + 1) is rank r.
    The tree has size - 1 nodes (32 bytes each: 320 kB at 10,000 ranks) and is the same on every rank.
    """

    axis: np.ndarray
    cut: np.ndarray
    child: np.ndarray
    size: int

    def owner(self, points):
        """Return the rank that owns each of `points` (n, dim), m. Local."""
        node = np.zeros(len(points), dtype=np.int64) if self.size > 1 else np.full(len(points), -1, dtype=np.int64)
        while True:
            inner = np.flatnonzero(node >= 0)
            if inner.size == 0:
                return -node - 1
            here = node[inner]
            right = points[inner, self.axis[here]] >= self.cut[here]
            node[inner] = self.child[here, right.astype(np.int64)]

    def ranks_near(self, points, reach):
        """Return (row, rank), (m,) int64 both: the points (n, dim), m, in the boxes of ranks grown by `reach`, m; each in its owner's, some in others' too. Local."""
        row = np.arange(len(points))
        node = np.zeros(len(points), np.int64) if self.size > 1 else np.full(len(points), -1, np.int64)
        rows, ranks = [], []
        while len(row):
            leaf = node < 0
            rows.append(row[leaf])
            ranks.append(-node[leaf] - 1)
            row, node = row[~leaf], node[~leaf]
            offset = points[row, self.axis[node]] - self.cut[node]
            left, right = offset < reach, offset >= -reach
            node = np.concatenate([self.child[node[left], 0], self.child[node[right], 1]])
            row = np.concatenate([row[left], row[right]])
        return tuple(np.concatenate(each) if each else np.empty(0, np.int64) for each in (rows, ranks))

    def box(self, rank, dim):
        """Return (lower, upper), m, of the half-open box that `rank` owns; outer sides are infinite. Local."""
        lower, upper = np.full(dim, -np.inf), np.full(dim, np.inf)
        node = -1 if self.size == 1 else 0
        first, last = 0, self.size
        while node >= 0:
            middle = first + (last - first) // 2
            right = rank >= middle
            axis, cut = self.axis[node], self.cut[node]
            if right:
                lower[axis] = max(lower[axis], cut)  # a node without points may be cut anywhere
            else:
                upper[axis] = min(upper[axis], cut)
            first, last = (middle, last) if right else (first, middle)
            node = int(self.child[node, int(right)])
        return lower, upper


class Nowhere(NamedTuple):
    """The partition as a rank without a share of the points sees it."""

    size: int = 1

    def box(self, rank, dim):
        """Return (lower, upper), m, of a box that holds nothing. Local."""
        return np.full(dim, np.inf), np.full(dim, np.inf)

    def owner(self, points):
        """Return (n,) zeros: not asked for any point. Local."""
        return np.zeros(len(points), dtype=np.int64)


class _Span(NamedTuple):
    """A node under construction: the ranks first..last-1 still have to share its points."""

    node: int
    first: int
    last: int

    @property
    def middle(self):
        return self.first + (self.last - self.first) // 2

    def left_share(self, shares):
        """Return the part of its weight that belongs on the left; shares (size,) of the ranks."""
        return shares[self.first : self.middle].sum() / shares[self.first : self.last].sum()


def share_out(works, size):
    """Return [(first rank, shares (n,))]: how `size` ranks share pieces of work evenly, one after the other.

    Laid end to end the pieces (works (n_pieces,), any unit) are cut into `size` equal intervals: a rank may have parts of several pieces. A border of two
    pieces within 2 % of a rank's work of a border of two ranks is moved there.
    """
    ends = np.concatenate(([0.0], np.cumsum(np.asarray(works, float))))
    ends = ends / ends[-1] * size
    whole = np.rint(ends)
    near = (np.abs(ends - whole) <= _SNAP) & (whole > 0) & (whole < size)
    ends = np.where(near, whole, ends)
    shared = []
    for start, end in zip(ends[:-1], ends[1:]):
        first, last = int(np.floor(start)), max(int(np.ceil(end)), int(np.floor(start)) + 1)
        first, last = min(first, size - 1), min(last, size)
        ranks = np.arange(first, last)
        shared.append((first, np.maximum(np.minimum(ranks + 1, end) - np.maximum(ranks, start), 1e-9)))
    return shared


def bisect(comm, points, weights, snap=None, shares=None):
    """Cut space into boxes of nearly equal weight, one for each rank, or of weights in proportion to `shares`. Collective.

    Each box is cut across its longest side at the weighted quantile, found by repeated histograms; weights are integers, so that the cuts do not depend
    on how the points are spread over ranks.

    Parameters
    ----------
    points : (n, dim) float, m; every point on exactly one rank.
    weights : (n,) int, work of each point (its number of bonds).
    snap : function (axis, coordinate, after) -> cut, or None: the cut just before or after the layer of points at a coordinate, such as between the layers
        of a lattice.
    shares : (size,) above 0, of each box; `comm.size` equal ones without.
    """
    shares = np.ones(comm.size) if shares is None else np.asarray(shares, float)
    size = len(shares)
    axis = np.zeros(max(size - 1, 1), dtype=np.int64)
    cut = np.zeros(max(size - 1, 1))
    child = np.full((max(size - 1, 1), 2), -1, dtype=np.int64)
    weights = np.asarray(weights, dtype=np.int64)
    node_of = np.zeros(len(points), dtype=np.int64)
    level, next_node = ([_Span(0, 0, size)] if size > 1 else []), 1
    while level:
        slots = np.full(size, -1, dtype=np.int64)
        for slot, span in enumerate(level):
            slots[span.node] = slot
        slot_of = np.where(node_of >= 0, slots[np.maximum(node_of, 0)], -1)
        axes, low, high, after = _cut_level(comm, points, weights, slot_of, np.array([span.left_share(shares) for span in level]))
        following = []
        for slot, span in enumerate(level):
            axis[span.node], cut[span.node] = axes[slot], high[slot] if after[slot] else low[slot]
            if snap is not None:
                cut[span.node] = snap(axes[slot], 0.5 * (low[slot] + high[slot]), after[slot])
            for side, (first, last) in enumerate(((span.first, span.middle), (span.middle, span.last))):
                if last - first == 1:
                    child[span.node, side] = -(first + 1)
                else:
                    child[span.node, side] = next_node
                    following.append(_Span(next_node, first, last))
                    next_node += 1
        active = np.flatnonzero(slot_of >= 0)
        here = node_of[active]
        right = points[active, axis[here]] >= cut[here]
        node_of[active] = child[here, right.astype(np.int64)]
        level = following
    return Partition(axis[: max(size - 1, 0)], cut[: max(size - 1, 0)], child[: max(size - 1, 0)], size)


def _cut_level(comm, points, weights, slot_of, shares):
    """Return (axis, low, high, after) of every node of one level of the tree: the cut is high where `after`, else low, with one layer in between. Collective."""
    from mpi4py import MPI

    count, dim = len(shares), points.shape[1]
    inside = slot_of >= 0
    slot, point, weight = slot_of[inside], points[inside], weights[inside]
    lower, upper = np.full((count, dim), np.inf), np.full((count, dim), -np.inf)
    np.minimum.at(lower, slot, point)
    np.maximum.at(upper, slot, point)
    comm.Allreduce(MPI.IN_PLACE, lower, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, upper, MPI.MAX)
    empty = ~np.isfinite(lower[:, 0])
    lower[empty], upper[empty] = 0.0, 0.0
    axes = np.argmax(upper - lower, axis=1)
    nodes = np.arange(count)
    low, high = lower[nodes, axes], np.nextafter(upper[nodes, axes], np.inf)
    coordinate = point[np.arange(len(slot)), axes[slot]]
    below = np.zeros(count, dtype=np.int64)  # weight left of `low`
    total = None
    for _ in range(_ROUNDS):
        width = (high - low) / _BINS
        width[width == 0.0] = 1.0
        within = (coordinate >= low[slot]) & (coordinate < high[slot])
        bins = np.minimum(((coordinate - low[slot]) / width[slot]).astype(np.int64), _BINS - 1)
        histogram = np.zeros((count, _BINS), dtype=np.int64)
        np.add.at(histogram.ravel(), (slot * _BINS + bins)[within], weight[within])
        comm.Allreduce(MPI.IN_PLACE, histogram, MPI.SUM)
        if total is None:
            total = histogram.sum(axis=1)
        upto = below[:, None] + np.cumsum(histogram, axis=1)
        target = shares * total
        chosen = np.minimum((upto < target[:, None]).sum(axis=1), _BINS - 1)
        low, high = low + chosen * width, np.where(chosen == _BINS - 1, high, low + (chosen + 1) * width)
        above = upto[nodes, chosen]
        below = above - histogram[nodes, chosen]
    nearer_low = target - below < above - target
    return axes, low, high, ~(nearer_low & (below > 0))
