"""Carry a mesh from rank 0 to the ranks: DMPlex distributes it by the program's own bisection, with one layer of overlap."""
import numpy as np

from pdhpc.fem.facets import DIM, FACETS, UNIT_CORNERS, find_stars
from pdhpc.fem.plex import PLEX_CORNERS
from pdhpc.fem.share import Share, order_owned_first
from pdhpc.parallel.partition import bisect


def migrate(comm, whole):
    """Return (share, regions, sets) of a rank: its Share, {name: (n_cells,) bool}, {name: (n, facet corners) int32 local vertices}. Collective.

    Cells go to ranks by bisection of their centres. Rank 0 holds all of the mesh, a plex of it and a record of each cell and vertex, about 900 bytes per
    hexahedron, until this is done; every rank sees the list of the named facets.

    whole : FileMesh on rank 0, None elsewhere.
    """
    head = (whole.kind, list(whole.regions), {name: (cell.astype(np.int64), facet) for name, (cell, facet) in whole.sets.items()}) if whole else None
    kind, names, sets = comm.bcast(head)
    fields = [("id", "i8"), ("owner", "i8"), ("corners", "i8", (len(UNIT_CORNERS[kind]),)), ("point", "f8", (DIM[kind],)), ("regions", "?", (len(names),))]
    dtype = np.dtype(fields)
    owner = _choose_owners(comm, whole, kind)
    records = _fill(whole, owner, dtype) if whole else np.empty(0, dtype)
    n_cells = len(owner)
    if comm.size > 1:
        records, n_cells = _distribute(comm, kind, whole, owner, records)
    share, order = _number(kind, records[:n_cells], records[n_cells:], comm.rank)
    regions = {name: records["regions"][:n_cells][order, column] for column, name in enumerate(names)}
    return share, regions, {name: _take_facets(share, *facets) for name, facets in sets.items()}


def _choose_owners(comm, whole, kind):
    """Return (n,) int64, the rank of each cell on rank 0, nothing elsewhere. Collective."""
    centres = np.zeros((0, DIM[kind]))
    if whole:
        centres = sum(whole.points[whole.cells[:, corner]] for corner in range(whole.cells.shape[1])) / whole.cells.shape[1]
    return bisect(comm, centres, np.ones(len(centres), np.int64)).owner(centres)


def _fill(whole, owner, dtype):
    """Return (n_cells + n_vertices,) records: of cells their ids, ranks, vertex ids and regions, of vertices their ids, ranks and coordinates."""
    records = np.zeros(len(whole.cells) + len(whole.points), dtype)
    cells, vertices = records[: len(whole.cells)], records[len(whole.cells) :]
    cells["id"], cells["owner"], cells["corners"] = np.arange(len(cells)), owner, whole.vertex_id[whole.cells]
    for column, marks in enumerate(whole.regions.values()):
        cells["regions"][:, column] = marks
    start, star = find_stars(whole.cells, len(vertices))
    vertices["id"], vertices["owner"], vertices["point"] = whole.vertex_id, owner[star[start[:-1]]], whole.points
    return records


def _distribute(comm, kind, whole, owner, records):
    """Return (records, n_cells) of the cells and vertices that come to this rank. Collective."""
    from mpi4py import MPI
    from petsc4py import PETSc

    cells, points = np.zeros((0, len(UNIT_CORNERS[kind])), PETSc.IntType), np.zeros((0, DIM[kind]))
    if whole:
        cells, points = whole.cells[:, PLEX_CORNERS[kind]].astype(PETSc.IntType), whole.points
    plex = PETSc.DMPlex().createFromCellList(DIM[kind], cells, points, interpolate=False, comm=comm)
    plex.setBasicAdjacency(False, True)  # cells are neighbours when they share a vertex
    partitioner = plex.getPartitioner()
    partitioner.setType("shell")
    sizes = np.bincount(owner, minlength=comm.size) if whole else np.zeros(comm.size)
    partitioner.setShellPartition(comm.size, sizes.astype(PETSc.IntType), np.argsort(owner, kind="stable").astype(PETSc.IntType))
    forest = plex.distribute(overlap=1)
    received = np.zeros(plex.getChart()[1], records.dtype)
    unit = MPI.BYTE.Create_contiguous(records.dtype.itemsize).Commit()
    as_bytes = records.view(np.uint8), received.view(np.uint8)
    forest.bcastBegin(unit, *as_bytes, MPI.REPLACE)
    forest.bcastEnd(unit, *as_bytes, MPI.REPLACE)
    unit.Free()
    first, last = plex.getHeightStratum(0)
    forest.destroy()
    plex.destroy()
    return received, max(last - first, 0)


def _number(kind, cells, vertices, rank):
    """Return (share, order): the Share made of records, and the order of its cells among theirs."""
    order, n_owned_cells = order_owned_first(cells["owner"], cells["id"], rank)
    cells = cells[order]
    vertices_in_order, n_owned = order_owned_first(vertices["owner"], vertices["id"], rank)
    vertices = vertices[vertices_in_order]
    by_id = np.argsort(vertices["id"])
    corners = by_id[np.searchsorted(vertices["id"], cells["corners"], sorter=by_id)].astype(np.int32)
    owners = cells["owner"][n_owned_cells:].copy(), vertices["owner"][n_owned:].copy()
    points = np.ascontiguousarray(vertices["point"])
    return Share(kind, corners, cells["id"].copy(), owners[0], points, vertices["id"].copy(), owners[1]), order


def _take_facets(share, cell_id, facet):
    """Return (n, facet corners) int32: those facets, of cells with ids `cell_id`, places in FACETS, that are of owned cells, as local vertices."""
    owned = share.cell_id[: len(share.cells) - len(share.cell_owner)]
    mine = np.flatnonzero(np.isin(cell_id, owned))
    cell = np.searchsorted(owned, cell_id[mine])
    return share.cells[cell[:, None], FACETS[share.kind][facet[mine]]]
