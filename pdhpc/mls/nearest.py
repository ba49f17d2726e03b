"""The owned particle nearest to each of many points, on a lattice by rounding, in a cloud by cells of one spacing."""
import math
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements, inlined, kernel
from pdhpc.kernels.family import MIXED

_TIE = 1e-9  # squared spacings: particles whose squared distances differ by less are equally near


class LatticeCells(NamedTuple):
    """Cells of a lattice, each with one particle or none: of LatticeArrays `step`, `cells`, `coordinate`; of PointArrays `block`; spacing, m."""

    step: np.ndarray
    cells: np.ndarray
    coordinate: np.ndarray
    block: np.ndarray
    spacing: float


class CloudCells(NamedTuple):
    """Particles of a cloud sorted into cells.

    cells (3,) int64, numbers of cells; lower (3,), m, their corner; start (n_cells + 1,) int64 and order (n,) int32: slots order[start[c]] ... are in cell c;
    reference (n, 2 | 4), m; id (n,) int64, global; spacing, m, the side of a cell.
    """

    cells: np.ndarray
    lower: np.ndarray
    start: np.ndarray
    order: np.ndarray
    reference: np.ndarray
    id: np.ndarray
    spacing: float


def cells_of_lattice(bonds, particles, spacing):
    """Return the LatticeCells of a rank's LatticeArrays and PointArrays. Local; allocates nothing."""
    return LatticeCells(bonds.step, bonds.cells, bonds.coordinate, particles.block, float(spacing))


def cells_of_cloud(particles, ids, spacing):
    """Return the CloudCells of a rank's particles, ghosts too. Local.

    particles : PointArrays. ids : (n,) int64, global ids by slot. spacing : m.
    """
    n, width = len(ids), min(particles.reference.shape[1], 3)
    place = np.zeros((n, 3))
    place[:, :width] = particles.reference[:, :width]
    lower = place.min(axis=0) if n else np.zeros(3)
    spacing = float(spacing)
    side = max(spacing, float((np.prod((place.max(axis=0) - lower) / spacing + 1.0) / (8.0 * n + 1000.0)) ** (1 / 3)) * spacing) if n else spacing
    index = np.floor((place - lower) / side).astype(np.int64)
    cells = index.max(axis=0) + 1 if n else np.ones(3, np.int64)
    cell = (index[:, 0] * cells[1] + index[:, 1]) * cells[2] + index[:, 2]
    start = np.concatenate(([0], np.cumsum(np.bincount(cell, minlength=int(np.prod(cells))))))
    return CloudCells(cells, lower, start, np.argsort(cell, kind="stable").astype(np.int32), particles.reference, ids, side)


def nearest(cells, owned, points, limit):
    """Return (n,) int32: the slot of the particle nearest to each point, or -1 where that is another rank's or there is none within `limit`. Local.

    Of particles equally near the one with the smallest global id is taken (of a lattice of several bodies: the first cell, last axis fastest). The choice
    is the same on any rank that owns the particle as long as `limit` is at most half the reach of bonds, since ghosts then hold every candidate.

    Parameters
    ----------
    cells : LatticeCells or CloudCells. owned : (n_slots,) bool. points : (n, dim), m. limit : m.
    """
    points = np.asarray(points, float)
    found = np.empty(len(points), np.int32)
    _find_nearest(cells, owned, points, float(limit), found)
    return found


def centre_cell(cells, x, axis):
    """Return the index of the cell, inside the grid or not, that a coordinate x lies in."""


def first_in(cells, a, b, c):
    """Return the first m of a cell of the grid."""


def end_in(cells, a, b, c):
    """Return one past the last m of a cell of the grid."""


def candidate(cells, m):
    """Return (slot, x, y, z, rank among equals) of candidate m."""


@implements(centre_cell, LatticeCells)
def _centre_cell_of_lattice(cells, x, axis):
    return np.int64(math.floor((x - cells.coordinate[axis, 0]) / cells.spacing + 0.5))


@implements(centre_cell, CloudCells)
def _centre_cell_of_cloud(cells, x, axis):
    return np.int64(math.floor((x - cells.lower[axis]) / cells.spacing))


@implements(first_in, LatticeCells)
def _first_in_lattice(cells, a, b, c):
    return (a * cells.cells[1] + b) * cells.cells[2] + c


@implements(first_in, CloudCells)
def _first_in_cloud(cells, a, b, c):
    return cells.start[(a * cells.cells[1] + b) * cells.cells[2] + c]


@implements(end_in, LatticeCells)
def _end_in_lattice(cells, a, b, c):
    return (a * cells.cells[1] + b) * cells.cells[2] + c + (cells.block[a * cells.step[0] + b * cells.step[1] + c * cells.step[2]] != MIXED)


@implements(end_in, CloudCells)
def _end_in_cloud(cells, a, b, c):
    return cells.start[(a * cells.cells[1] + b) * cells.cells[2] + c + 1]


@implements(candidate, LatticeCells)
def _candidate_of_lattice(cells, m):
    c, rest = m % cells.cells[2], m // cells.cells[2]
    a, b = rest // cells.cells[1], rest % cells.cells[1]
    slot = a * cells.step[0] + b * cells.step[1] + c * cells.step[2]
    return slot, cells.coordinate[0, a], cells.coordinate[1, b], cells.coordinate[2, c], m


@implements(candidate, CloudCells)
def _candidate_of_cloud(cells, m):
    slot = np.int64(cells.order[m])
    z = cells.reference[slot, 2] if cells.reference.shape[1] > 2 else 0.0
    return slot, cells.reference[slot, 0], cells.reference[slot, 1], z, cells.id[slot]


@inlined
def _least_distance2(cells, x, y, z, rings):
    """Return the squared distance of the nearest particle in the cells up to `rings` away from the point's own, m^2; inf if there is none."""
    least = np.inf
    at_a, at_b, at_c = centre_cell(cells, x, 0), centre_cell(cells, y, 1), centre_cell(cells, z, 2)
    for a in range(max(0, at_a - rings), min(cells.cells[0], at_a + rings + 1)):
        for b in range(max(0, at_b - rings), min(cells.cells[1], at_b + rings + 1)):
            for c in range(max(0, at_c - rings), min(cells.cells[2], at_c + rings + 1)):
                for m in range(first_in(cells, a, b, c), end_in(cells, a, b, c)):
                    _, px, py, pz, _ = candidate(cells, m)
                    least = min(least, (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2)
    return least


@inlined
def _first_within(cells, x, y, z, rings, distance2):
    """Return the slot of the first in rank of the particles up to a squared distance, m^2, away."""
    chosen, best = np.int64(-1), np.int64(0)
    at_a, at_b, at_c = centre_cell(cells, x, 0), centre_cell(cells, y, 1), centre_cell(cells, z, 2)
    for a in range(max(0, at_a - rings), min(cells.cells[0], at_a + rings + 1)):
        for b in range(max(0, at_b - rings), min(cells.cells[1], at_b + rings + 1)):
            for c in range(max(0, at_c - rings), min(cells.cells[2], at_c + rings + 1)):
                for m in range(first_in(cells, a, b, c), end_in(cells, a, b, c)):
                    slot, px, py, pz, rank = candidate(cells, m)
                    if (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2 <= distance2 and (chosen < 0 or rank < best):
                        chosen, best = slot, rank
    return chosen


@kernel
def _find_nearest(cells, owned, points, limit, found):
    """Store in found (n,) the slot of the nearest particle, or -1: see `nearest`."""
    tie, widest = _TIE * cells.spacing**2, np.int64(math.ceil(limit / cells.spacing))
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2] if points.shape[1] > 2 else 0.0
        rings = np.int64(1)
        least = _least_distance2(cells, x, y, z, rings)
        if least + tie > cells.spacing**2:  # a particle beyond these cells may be as near
            rings = widest
            least = _least_distance2(cells, x, y, z, rings)
        found[n] = -1
        if least <= limit**2:
            slot = _first_within(cells, x, y, z, rings, least + tie)
            if owned[slot]:
                found[n] = slot
