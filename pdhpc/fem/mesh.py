"""The distributed mesh: one rank's cells with one layer around them, on a DMPlex, made of a box or read from a file."""
import numpy as np

from pdhpc.fem.box_mesh import Box, cell_partition, take_box_share
from pdhpc.fem.facets import DIM, FACETS, find_outer_facets, find_stars
from pdhpc.fem.mesh_file import read_file
from pdhpc.fem.migrate import migrate
from pdhpc.fem.plex import build_plex
from pdhpc.parallel.comm import agree_on_error
from pdhpc.parallel.ghosts import GhostExchange

__all__ = ["Mesh", "cell_partition", "make_box_mesh", "read_mesh"]


class Mesh:
    """One rank's share of a mesh: its owned cells, then every other cell that shares a vertex with one, so that all cells around owned vertices are there.

    A vertex belongs to the owner of the cell with the smallest id around it. Costs about 320 bytes per hexahedron and 210 per quad, most of them in the plex.

    comm, dim : 2 or 3. kind : "triangle", "quad", "tetra" or "hexahedron". dm : the DMPlex, whose points are the local cells, then the local vertices.
    cells : (n_cells, corners) int32, local vertices in VTK order. n_owned_cells : the first of them; ghosts follow by (owner, id).
    cell_id : (n_cells,) int64, global, of owned cells ascending. cell_owner : (n_ghost_cells,) int64, ranks.
    points : (n_vertices, dim), m. n_owned : the first of them, ascending in id; ghosts follow by (owner, id). vertex_id : (n_vertices,) int64, global.
    vertex_owner : (n_ghost_vertices,) int64, ranks. n_global_cells, n_global_vertices : of the whole mesh; ids may have gaps.
    exchange, cell_exchange : GhostExchange of vertices and of cells.
    regions : {name: (n_cells,) bool}. sets : {name: (n_facets, facet corners) int32}, facets of owned cells on the surface, outward as in FACETS.
    repeated : cells of its file that were left out, see mesh_file.count_repeated.
    cell_size : (dim,), m, of the one shape that all cells of a box have, else None. counts : (dim,) cells along each axis of the box, or None.
    """

    def __init__(self, comm, share, regions=None, sets=None, box=None):
        """Join the ranks' shares. Collective.

        share : Share. regions, sets : as above. box : the Box whose cells these are, or None.
        """
        self.comm, self.kind, self.dim = comm, share.kind, DIM[share.kind]
        self.cells, self.cell_id, self.cell_owner = share.cells, share.cell_id, share.cell_owner
        self.points, self.vertex_id, self.vertex_owner = share.points, share.vertex_id, share.vertex_owner
        self.n_owned_cells = len(self.cells) - len(self.cell_owner)
        self.n_owned = len(self.points) - len(self.vertex_owner)
        self.regions, self.sets, self.repeated = regions or {}, sets or {}, 0
        self.cell_size, self.counts = (None, None) if box is None else (box.cell_size, tuple(box.counts))
        self.exchange = GhostExchange(comm, self.vertex_id[: self.n_owned], self.vertex_id[self.n_owned :], self.vertex_owner)
        self.cell_exchange = GhostExchange(comm, self.cell_id[: self.n_owned_cells], self.cell_id[self.n_owned_cells :], self.cell_owner)
        self.dm = build_plex(comm, share, self.cell_exchange, self.exchange)
        totals = np.array([self.n_owned_cells, self.n_owned], np.int64)
        self.n_global_cells, self.n_global_vertices = (int(total) for total in comm.allreduce(totals))

    @property
    def index(self):
        """(n_cells, dim) int64, the places of a box's cells along its axes; None on other meshes. Local."""
        return None if self.counts is None else np.stack(np.unravel_index(self.cell_id, self.counts), axis=1)

    def boundary(self):
        """Return (facets, cell): (n, facet corners) int32 local vertices, outward as in FACETS, of all facets of owned cells on the body's surface. Local.

        Each such facet is on exactly one rank. cell : (n,) int32, the owned cell of each, ascending.
        """
        cell, facet = find_outer_facets(self.kind, self.cells, self.n_owned_cells, len(self.points))
        return self.cells[cell[:, None], FACETS[self.kind][facet]], cell

    def stars(self):
        """Return (start, star), int32: the local cells around vertex v, in local order, are star[start[v] : start[v + 1]]; of owned vertices all. Local."""
        return find_stars(self.cells, len(self.points))


def make_box_mesh(comm, lower, upper, counts, partition, keep=None):
    """Return the Mesh of a box of equal quads or hexahedra. Collective.

    Every rank works out its own cells and those around them; only the numbers of ghosts are exchanged with neighbours. Ids of cells and of vertices are
    lexicographic over the whole box, the last axis fastest, cells left out included.

    Parameters
    ----------
    lower, upper : (dim,), m. counts : (dim,) cells along each axis.
    partition : Partition with a box for every rank of `comm`; a cell belongs to the owner of its centre.
    keep : None, or function centres (n, dim), m -> (n,) bool, False where there is no cell; called on cells near this rank only.

    Raises
    ------
    ValueError: as Box.of, or no cell is left at all; what `keep` raises on any rank.
    """
    with agree_on_error(comm):
        box = Box.of(lower, upper, counts)
        share = take_box_share(box, partition, comm.rank, keep)
    mesh = Mesh(comm, share, box=box)
    if mesh.n_global_cells == 0:
        raise ValueError("the mesh has no cell: all cells of the box are left out")
    return mesh


def read_mesh(comm, path):
    """Return the Mesh of a file that meshio can read, of one kind of cell. Collective.

    Rank 0 reads it all; DMPlex then carries cells and what belongs to them to ranks of nearly equal numbers of cells. Ids of cells count them in the file's
    order, ids of vertices are the places of the file's points.

    Raises
    ------
    ValueError, on every rank: as mesh_file.read_file.
    """
    whole = None
    with agree_on_error(comm):
        whole = read_file(path) if comm.rank == 0 else None
    mesh = Mesh(comm, *migrate(comm, whole))
    mesh.repeated = comm.bcast(None if whole is None else whole.repeated)
    return mesh
