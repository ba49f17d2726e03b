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
    1/m, inverse reference length (padding: any finite number); alive (n_slots / 8,) uint8, bit k & 7 of byte k >> 3 is slot k (padding: 0).
    """

    row_start: np.ndarray
    neighbour: np.ndarray
    inv_length: np.ndarray
    alive: np.ndarray


class CorrectedArrays(NamedTuple):
    """As BondArrays, with factor (n_slots,) of each bond's micromodulus: the surface correction (kernels/surface.py)."""

    row_start: np.ndarray
    neighbour: np.ndarray
    inv_length: np.ndarray
    alive: np.ndarray
    factor: np.ndarray


class Cells(NamedTuple):
    """Points sorted into cells; see cell_list."""

    lower: np.ndarray  # (3,) m
    per_length: float  # cells per metre
    counts: np.ndarray  # (3,)
    start: np.ndarray  # (n_cells + 1,) first particle of each cell in sorted order
    order: np.ndarray  # (n,) int32, sorted -> given order
    position: np.ndarray  # (n, 3) sorted positions, m


def cell_list(points, radius, per_radius=_CELLS_PER_RADIUS):
    """Return the Cells of points (n, dim), of side radius/per_radius (larger where the body is sparse). Local."""
    padded = np.zeros((len(points), 3))
    padded[:, : points.shape[1]] = points
    lower = padded.min(axis=0) if len(points) else np.zeros(3)
    extent = (padded.max(axis=0) if len(points) else np.zeros(3)) - lower
    per_length, counts = per_radius / (radius * (1 + 1e-6)), None
    while counts is None or np.prod(counts, dtype=float) > 4.0 * len(points) + 1000:
        per_length = per_length if counts is None else per_length / 2
        counts = np.floor(extent * per_length).astype(np.int64) + 1
    start, order = _sort_into_cells(padded, lower, per_length, counts)
    return Cells(lower, per_length, counts, start, order, padded[order])


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
def _search(points, n_rows, cells, radius2, group, reach2, ids, row_start, neighbour, inv_length, counts):
    """Count (neighbour empty) or store the neighbours of the first n_rows points, sorted by id, and their inverse lengths.

    group (n,), reach2 (n_groups, n_groups), m^2: the radius by pairs of groups, radius2 the largest; both empty where it is one for all.
    Of each column of cells along z only the stretch that the ball around the point reaches is read.
    """
    lower, per_length, position, start_of, order = cells.lower, cells.per_length, cells.position, cells.start, cells.order
    nx, ny, nz = cells.counts[0], cells.counts[1], cells.counts[2]
    storing, flat, one_radius = len(neighbour) > 0, points.shape[1] == 2, len(group) == 0
    size, radius = 1.0 / per_length, np.sqrt(radius2)
    for i in range(n_rows):
        px, py, pz = points[i, 0], points[i, 1], 0.0 if flat else points[i, 2]
        x, y, z = px - lower[0], py - lower[1], 0.0 if flat else pz - lower[2]
        first = row_start[i] if storing else np.int64(0)
        found = np.int64(0)
        for a in range(max(0, np.int64((x - radius) * per_length)), min(nx - 1, np.int64((x + radius) * per_length)) + 1):
            gap_x = max(0.0, a * size - x, x - (a + 1) * size)
            for b in range(max(0, np.int64((y - radius) * per_length)), min(ny - 1, np.int64((y + radius) * per_length)) + 1):
                gap_y = max(0.0, b * size - y, y - (b + 1) * size)
                reach = np.sqrt(max(0.0, radius2 - gap_x * gap_x - gap_y * gap_y)) + 1e-9 * size
                column = (a * ny + b) * nz
                start = start_of[column + max(0, np.int64((z - reach) * per_length))]
                stop = start_of[column + min(nz - 1, np.int64((z + reach) * per_length)) + 1]
                if not storing:
                    for s in range(start, stop):
                        dx, dy, dz = position[s, 0] - px, position[s, 1] - py, position[s, 2] - pz
                        found += dx * dx + dy * dy + dz * dz <= (radius2 if one_radius else reach2[group[i], group[order[s]]])
                    continue
                for s in range(start, stop):
                    dx, dy, dz = position[s, 0] - px, position[s, 1] - py, position[s, 2] - pz
                    distance2 = dx * dx + dy * dy + dz * dz
                    j = order[s]
                    if j != i and distance2 <= (radius2 if one_radius else reach2[group[i], group[j]]):
                        slot = first + found
                        while slot > first and ids[neighbour[slot - 1]] > ids[j]:
                            neighbour[slot], inv_length[slot] = neighbour[slot - 1], inv_length[slot - 1]
                            slot -= 1
                        neighbour[slot], inv_length[slot] = j, 1.0 / np.sqrt(distance2)
                        found += 1
        counts[i] = found if storing else found - 1  # counting saw the point itself


@kernel
def _finish_rows(row_start, counts, neighbour, inv_length, alive):
    """Set the bits of the bonds and fill the padding with something valid."""
    for i in range(len(counts)):
        first = row_start[i]
        end = first + counts[i]
        for k in range(first, end):
            alive[k >> 3] |= np.uint8(1 << (k & 7))
        for k in range(end, row_start[i + 1]):
            neighbour[k], inv_length[k] = neighbour[first], inv_length[first]


def _radii(radius, group):
    """Return (the largest radius, m, group, squares of radii by pairs of groups, m^2) as _search takes them."""
    if np.ndim(radius) == 0:
        return float(radius), np.empty(0, np.int32), np.empty((0, 0))
    table = np.asarray(radius, dtype=float)
    return float(table.max()), np.asarray(group, dtype=np.int32), table**2


def count_neighbours(points, n_rows, radius, group=None):
    """Return (n_rows,) int32: how many points lie within the radius of each of the first n_rows points (n, dim), m. Local.

    radius : m, or a symmetric table (n_groups, n_groups) of radii by pairs of groups; group : (n,) of the points, with a table. Groups at radius 0 only see
    points at the same place.
    """
    largest, group, reach2 = _radii(radius, group)
    counts = np.empty(n_rows, np.int32)
    nothing = np.empty(0, np.int64)
    _search(points, n_rows, cell_list(points, largest), largest**2, group, reach2, nothing, nothing, np.empty(0, np.int32), np.empty(0), counts)
    return counts


def find_bonds(points, ids, n_rows, radius, group=None):
    """Return (BondArrays, family sizes) of the first n_rows points, all bonds alive. Local.

    Parameters
    ----------
    points : (n, dim) m; ids : (n,) int64 global ids, distinct; radius, group : as of count_neighbours.
    """
    counts = count_neighbours(points, n_rows, radius, group)
    largest, group, reach2 = _radii(radius, group)
    row_start = np.zeros(n_rows + 1, np.int64)
    np.cumsum((counts.astype(np.int64) + LANES - 1) // LANES * LANES, out=row_start[1:])
    slots = int(row_start[-1])
    bonds = BondArrays(row_start, np.empty(slots, np.int32), np.empty(slots), np.zeros(slots // LANES, np.uint8))
    if slots:
        _search(points, n_rows, cell_list(points, largest), largest**2, group, reach2, ids, row_start, bonds.neighbour, bonds.inv_length, counts)
        _finish_rows(row_start, counts, bonds.neighbour, bonds.inv_length, bonds.alive)
    return bonds, counts


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
