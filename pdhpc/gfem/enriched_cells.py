"""The enriched cells around a rank's vertices: who shares them with whom, and the lists along which their contributions are gathered."""
from typing import NamedTuple

import numpy as np

from pdhpc.parallel.ghosts import GhostExchange


class Stars(NamedTuple):
    """The enriched cells around each owned vertex that has one, in ascending global id, and the vertices of these cells.

    vertex (n,) int32, local, ascending. Cells of vertex[i]: rows k = start[i] ... start[i + 1] - 1 of cell (m,) int32, rows of EnrichedCells, and corner (m,),
    which of its corners the vertex is. Neighbours of vertex[i], itself among them, ascending in global id: first[i] ... first[i + 1] - 1 of neighbour
    (., ) int32, local vertices. slot (m, corners) int32: where among these, counted from first[i], the corners of cell[k] stand.
    """

    vertex: np.ndarray
    start: np.ndarray
    cell: np.ndarray
    corner: np.ndarray
    slot: np.ndarray
    first: np.ndarray
    neighbour: np.ndarray


class EnrichedCells:
    """The enriched cells of a rank: its own, then those of other ranks around its owned vertices.

    Attributes
    ----------
    corners (n_cells, corners) int32, local vertices. n_owned : the first of them. start (n_owned + 1,) int64 : the points of owned cells, as in Points, cells
    without any left out. exchange : GhostExchange of rows. stars : Stars.
    """

    def __init__(self, mesh, points):
        """Find out which cells around owned vertices other ranks have enriched. Collective.

        mesh : fem.mesh.Mesh. points : Points of owned cells.

        Raises
        ------
        ValueError: the cells of points are not ascending.
        """
        if (np.diff(points.cell) <= 0).any():
            raise ValueError("points are given cell by cell in ascending order")
        filled = np.flatnonzero(np.diff(points.start) > 0)
        owned = points.cell[filled]
        self.start = np.append(points.start[:-1][filled], points.start[-1]).astype(np.int64)
        marked = np.zeros(len(mesh.cells), np.int64)
        marked[owned] = 1
        bound = mesh.cell_exchange.bind(marked)
        bound.refresh()
        bound.free()
        ghosts = mesh.n_owned_cells + np.flatnonzero(marked[mesh.n_owned_cells :])
        self.n_owned = len(owned)
        cells = np.concatenate((owned, ghosts))
        self.corners = np.ascontiguousarray(mesh.cells[cells])
        self.exchange = GhostExchange(mesh.comm, mesh.cell_id[owned], mesh.cell_id[ghosts], mesh.cell_owner[ghosts - mesh.n_owned_cells])
        self.stars = _stars(self.corners, mesh.cell_id[cells], mesh.n_owned, mesh.vertex_id)


def _stars(corners, cell_id, n_owned, vertex_id):
    """Return the Stars of cells `corners` (n_cells, corners) around the first n_owned vertices."""
    cell, corner = np.nonzero(corners < n_owned)
    order = np.lexsort((cell_id[cell], corners[cell, corner]))
    cell, corner = cell[order].astype(np.int32), corner[order].astype(np.int32)
    vertex, start = np.unique(corners[cell, corner], return_index=True)
    start = np.append(start, len(cell)).astype(np.int64)
    row = np.repeat(np.arange(len(vertex)), np.diff(start))
    around = corners[cell]
    ranked = np.empty(len(vertex_id), np.int64)
    ranked[np.argsort(vertex_id)] = np.arange(len(vertex_id))
    keys, place = np.unique(row[:, None] * len(vertex_id) + ranked[around], return_inverse=True)
    first = np.searchsorted(keys, np.arange(len(vertex) + 1) * len(vertex_id)).astype(np.int64)
    slot = place.reshape(around.shape) - first[row][:, None]
    neighbour = np.argsort(vertex_id)[keys % max(1, len(vertex_id))]
    return Stars(vertex.astype(np.int32), start, cell, corner, slot.astype(np.int32), first, neighbour.astype(np.int32))
