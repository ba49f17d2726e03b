"""Kinds of cells: their corners and facets in VTK order, the cells around vertices, and the facets on the surface of a body."""
import numpy as np

from pdhpc.jit import kernel

DIM = {"triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3}
"""Space dimension of each kind of cell."""

UNIT_CORNERS = {
    "quad": np.array([(0, 0), (1, 0), (1, 1), (0, 1)]),
    "hexahedron": np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]),
    "triangle": np.array([(0, 0), (1, 0), (0, 1)]),
    "tetra": np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]),
}
"""Reference coordinates (corners, dim) of the corners of each kind of cell."""

FACETS = {
    "triangle": np.array([(0, 1), (1, 2), (2, 0)], np.int32),
    "quad": np.array([(0, 1), (1, 2), (2, 3), (3, 0)], np.int32),
    "tetra": np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], np.int32),
    "hexahedron": np.array([(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], np.int32),
}
"""Corners (n_facets, facet corners) of the facets of each kind of cell.

Seen from outside a face runs counter-clockwise; an edge of a plane cell has the outside on its right: the outward normal of (a, b) is along
(y_b - y_a, x_a - x_b), of a face along (x_1 - x_0) x (x_2 - x_0).
"""


@kernel
def find_stars(cells, n_vertices):
    """Return (start, star): the cells around vertex v, ascending, are star[start[v] : start[v + 1]]. Local.

    cells : (n, corners) int32. start : (n_vertices + 1,) int32. star : (n corners,) int32.
    """
    start = np.zeros(n_vertices + 1, np.int32)
    for cell in range(cells.shape[0]):
        for corner in range(cells.shape[1]):
            start[cells[cell, corner] + 1] += 1
    for vertex in range(n_vertices):
        start[vertex + 1] += start[vertex]
    star, filled = np.empty(cells.size, np.int32), start[:-1].copy()
    for cell in range(cells.shape[0]):
        for corner in range(cells.shape[1]):
            vertex = cells[cell, corner]
            star[filled[vertex]] = cell
            filled[vertex] += 1
    return start, star


def find_outer_facets(kind, cells, n_owned, n_vertices):
    """Return (cell, facet), (n,) int32 each: the facets of the first `n_owned` cells that no other cell shares, by cell, then by place in FACETS. Local.

    All cells around the vertices of those cells must be among `cells` (n_cells, corners), or facets between ranks would count as outer ones.
    """
    cell, facet = np.nonzero(find_neighbours(kind, cells, n_owned, n_vertices) < 0)
    return cell.astype(np.int32), facet.astype(np.int32)


def find_neighbours(kind, cells, n, n_vertices):
    """Return (n, n_facets) int32: the cell beyond each facet of the first n cells, by place in FACETS, -1 where none of `cells` (n_cells, corners) is. Local."""
    start, star = find_stars(cells, n_vertices)
    corners = FACETS[kind]
    neighbours = np.empty((n, len(corners)), np.int32)
    _list_neighbours(cells, corners, start, star, neighbours)
    return neighbours


@kernel
def _list_neighbours(cells, corners, start, star, neighbours):
    """Set neighbours[cell, facet] to the other cell around the facet's first vertex that has all its vertices, or to -1."""
    for cell in range(neighbours.shape[0]):
        for facet in range(neighbours.shape[1]):
            first = cells[cell, corners[facet, 0]]
            beyond = -1
            for k in range(start[first], start[first + 1]):
                other = star[k]
                if other == cell:
                    continue
                shared = True
                for m in range(1, corners.shape[1]):
                    vertex, found = cells[cell, corners[facet, m]], False
                    for corner in range(cells.shape[1]):
                        found = found or cells[other, corner] == vertex
                    if not found:
                        shared = False
                        break
                if shared:
                    beyond = other
                    break
            neighbours[cell, facet] = beyond
