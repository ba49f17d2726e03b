"""Neighbours within the family radius by cell lists: particles sorted by cell, the cells of one column read as one range.

Cells have a third of the radius, so that in a lattice of radius 3 spacings a cell holds one particle and rows come out nearly sorted by id.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import kernel

LANES = 8
"""Rows are padded to a multiple of this, so that a row's states fill whole bytes and its slots whole vectors."""

_CELLS_PER_RADIUS = 3


class BondArrays(NamedTuple):
    """Families of the owned particles, rows sorted by the neighbours' global ids and padded to whole blocks of eight slots.

    row_start (n_owned + 1,) int64, first slot of each row; neighbour (n_slots,) int32, local index (padding: a valid index); inv_length (n_slots,) float,
    1/m, inverse reference length (padding: 1/radius); alive (n_slots / 8,) uint8, bit k & 7 of byte k >> 3 is slot k (padding: 0).
    """

    row_start: np.ndarray
    neighbour: np.ndarray
    inv_length: np.ndarray
    alive: np.ndarray


class _Cells(NamedTuple):
    lower: np.ndarray  # (3,) m
    per_length: float  # cells per metre
    counts: np.ndarray  # (3,)
    start: np.ndarray  # (n_cells + 1,) first particle of each cell in sorted order
    order: np.ndarray  # (n,) int32, sorted -> given order
    position: np.ndarray  # (n, 3) sorted positions, m


def _cell_list(points, radius):
    """Sort points (n, dim) into cells of radius/3 (larger where the body is sparse)."""
    padded = np.zeros((len(points), 3))
    padded[:, : points.shape[1]] = points
    lower = padded.min(axis=0) if len(points) else np.zeros(3)
    extent = (padded.max(axis=0) if len(points) else np.zeros(3)) - lower
    per_length, counts = _CELLS_PER_RADIUS / radius, None
    while counts is None or np.prod(counts, dtype=float) > 4.0 * len(points) + 1000:
        per_length = per_length if counts is None else per_length / 2
        counts = np.floor(extent * per_length).astype(np.int64) + 1
    start, order = _sort_into_cells(padded, lower, per_length, counts)
    return _Cells(lower, per_length, counts, start, order, padded[order])


@kernel
def _sort_into_cells(points, lower, per_length, counts):
    n = len(points)
    cell = np.empty(n, np.int64)
    start = np.zeros(counts[0] * counts[1] * counts[2] + 1, np.int64)
    for i in range(n):
        c = np.int64(0)
        for d in range(3):
            c = c * counts[d] + min(np.int64((points[i, d] - lower[d]) * per_length), counts[d] - 1)
        cell[i] = c
        start[c + 1] += 1
    for c in range(len(start) - 1):
        start[c + 1] += start[c]
    following = start[:-1].copy()
    order = np.empty(n, np.int32)
    for i in range(n):
        order[following[cell[i]]] = i
        following[cell[i]] += 1
    return start, order


@kernel
def _search(points, n_rows, cells, radius2, reach, ids, row_start, neighbour, counts):
    """Count (neighbour empty) or store the neighbours of the first n_rows points, sorted by id."""
    storing = len(neighbour) > 0
    dim = points.shape[1]
    nz = cells.counts[2]
    for i in range(n_rows):
        x, y = points[i, 0], points[i, 1]
        z = points[i, 2] if dim == 3 else 0.0
        cx = min(np.int64((x - cells.lower[0]) * cells.per_length), cells.counts[0] - 1)
        cy = min(np.int64((y - cells.lower[1]) * cells.per_length), cells.counts[1] - 1)
        cz = min(np.int64((z - cells.lower[2]) * cells.per_length), nz - 1)
        first = row_start[i] if storing else np.int64(0)
        found = np.int64(0)
        for a in range(max(0, cx - reach), min(cells.counts[0], cx + reach + 1)):
            for b in range(max(0, cy - reach), min(cells.counts[1], cy + reach + 1)):
                column = (a * cells.counts[1] + b) * nz
                for s in range(cells.start[column + max(0, cz - reach)], cells.start[column + min(nz - 1, cz + reach) + 1]):
                    dx, dy, dz = cells.position[s, 0] - x, cells.position[s, 1] - y, cells.position[s, 2] - z
                    j = cells.order[s]
                    if dx * dx + dy * dy + dz * dz <= radius2 and j != i:
                        if storing:
                            slot = first + found
                            while slot > first and ids[neighbour[slot - 1]] > ids[j]:
                                neighbour[slot] = neighbour[slot - 1]
                                slot -= 1
                            neighbour[slot] = j
                        found += 1
        counts[i] = found


def _search_arguments(cells, radius):
    return radius**2, int(np.ceil(radius * cells.per_length))


def count_neighbours(points, n_rows, radius):
    """Return (n_rows,) int32: how many points lie within the radius of each of the first n_rows points (n, dim), m. Local."""
    cells = _cell_list(points, radius)
    radius2, reach = _search_arguments(cells, radius)
    counts = np.empty(n_rows, np.int32)
    _search(points, n_rows, cells, radius2, reach, np.empty(0, np.int64), np.zeros(1, np.int64), np.empty(0, np.int32), counts)
    return counts


def find_bonds(points, ids, n_rows, radius):
    """Return (BondArrays, family sizes) of the first n_rows points, all bonds alive. Local.

    Parameters
    ----------
    points : (n, dim) m; ids : (n,) int64 global ids, distinct; radius : m.
    """
    cells = _cell_list(points, radius)
    radius2, reach = _search_arguments(cells, radius)
    counts = np.empty(n_rows, np.int32)
    _search(points, n_rows, cells, radius2, reach, ids, np.zeros(1, np.int64), np.empty(0, np.int32), counts)
    row_start = np.zeros(n_rows + 1, np.int64)
    np.cumsum((counts.astype(np.int64) + LANES - 1) // LANES * LANES, out=row_start[1:])
    neighbour = np.empty(row_start[-1], np.int32)
    if len(neighbour):
        _search(points, n_rows, cells, radius2, reach, ids, row_start, neighbour, counts)
    inv_length = np.empty(row_start[-1])
    alive = np.zeros(row_start[-1] // LANES, np.uint8)
    _finish_rows(points, radius, row_start, counts, neighbour, inv_length, alive)
    return BondArrays(row_start, neighbour, inv_length, alive), counts


@kernel
def _finish_rows(points, radius, row_start, counts, neighbour, inv_length, alive):
    """Fill padding, inverse lengths and alive bits."""
    dim = points.shape[1]
    for i in range(len(counts)):
        first = row_start[i]
        for k in range(first, row_start[i + 1]):
            if k - first >= counts[i]:
                neighbour[k] = neighbour[first]
                inv_length[k] = 1.0 / radius
                continue
            j = neighbour[k]
            length2 = 0.0
            for d in range(dim):
                length2 += (points[j, d] - points[i, d]) ** 2
            inv_length[k] = 1.0 / np.sqrt(length2)
            alive[k >> 3] |= np.uint8(1 << (k & 7))


@kernel
def mark_used(neighbour, n_points):
    """Return (n_points,) bool: which points occur as a neighbour."""
    used = np.zeros(n_points, np.bool_)
    for k in range(len(neighbour)):
        used[neighbour[k]] = True
    return used


@kernel
def renumber(neighbour, new_index):
    """Replace every local index in `neighbour` by `new_index` of it, in place."""
    for k in range(len(neighbour)):
        neighbour[k] = new_index[neighbour[k]]
