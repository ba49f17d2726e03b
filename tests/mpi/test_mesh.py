"""A mesh that is spread over ranks is the one that a single rank would hold."""
import ctypes

import meshio
import numpy as np
import pytest

from pdhpc.fem.box_mesh import Box, take_box_share
from pdhpc.fem.facets import DIM
from pdhpc.fem.mesh import cell_partition, make_box_mesh, read_mesh
from pdhpc.fem.plex import call_petsc
from pdhpc.parallel.partition import Partition

ALONE = Partition(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), 1)
LOWER, UPPER = np.array([0.0, 1.0, -1.0]), np.array([2.0, 2.0, 0.0])
SIX_TETRAHEDRA = [(0, 6, a, b) for a, b in ((1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1))]  # around the diagonal 0-6 of a hexahedron
NOTCHED = {
    "all": None,
    "hole": lambda centres: ((centres[:, :2] - [1.0, 1.5]) ** 2).sum(axis=1) > 0.09,
    "left": lambda centres: centres[:, 0] < 0.6,  # with equal shares of the box one rank has no cell
}


def the_box(comm, counts, keep):
    dim = len(counts)
    partition = cell_partition(comm, LOWER[:dim], UPPER[:dim], counts)
    return make_box_mesh(comm, LOWER[:dim], UPPER[:dim], counts, partition, NOTCHED[keep])


def cells_of(kind, n):
    """Return (points, cells) of the box as cells of a kind, along its first axis 2 n of them."""
    counts = (2 * n, n) if DIM[kind] == 2 else (2 * n, n, n)
    share = take_box_share(Box.of(LOWER[: DIM[kind]], UPPER[: DIM[kind]], counts), ALONE, 0)
    if kind == "triangle":
        return share.points, np.concatenate([share.cells[:, [0, 1, 2]], share.cells[:, [0, 2, 3]]])
    if kind == "tetra":
        return share.points, np.concatenate([share.cells[:, corners] for corners in SIX_TETRAHEDRA])
    return share.points, share.cells


def the_file(comm, tmp_path_factory, kind, n):
    """Write, on rank 0, the box with the region "left" and the set of points "end" at the largest x; return its path on every rank."""
    path = None
    if comm.rank == 0:
        points, cells = cells_of(kind, n)
        cells = cells[np.random.default_rng(0).permutation(len(cells))]
        left = np.flatnonzero(points[cells].mean(axis=1)[:, 0] < 1.0)
        path = tmp_path_factory.mktemp("mesh") / "box.inp"
        kinds = {"quad": "CPS4", "triangle": "CPS3", "tetra": "C3D4", "hexahedron": "C3D8"}
        lines = ["*NODE", *(", ".join([str(k + 1), *(repr(float(x)) for x in p)]) for k, p in enumerate(points)), f"*ELEMENT, TYPE={kinds[kind]}"]
        lines += [", ".join(map(str, [k + 1, *(c + 1)])) for k, c in enumerate(cells)]
        lines += ["*ELSET, ELSET=left", *(f"{k + 1}," for k in left), "*NSET, NSET=end", *(f"{k + 1}," for k in np.flatnonzero(points[:, 0] == 2.0))]
        path.write_text("\n".join(lines) + "\n")
    return comm.bcast(path)


def gather(comm, mesh):
    """Return {cell id: vertex ids} of the whole mesh; each cell is owned once."""
    owned = [item for part in comm.allgather([*zip(mesh.cell_id.tolist(), mesh.vertex_id[mesh.cells].tolist())][: mesh.n_owned_cells]) for item in part]
    assert len(owned) == len(dict(owned)) == mesh.n_global_cells
    return dict(owned)


def check_share(comm, mesh):
    """Owned cells, exactly one layer around them, owners, order and exchange are what Mesh says."""
    whole = gather(comm, mesh)
    rank_of = {number: rank for rank, numbers in enumerate(comm.allgather(mesh.cell_id[: mesh.n_owned_cells].tolist())) for number in numbers}
    mine = {vertex for number in whole if rank_of[number] == comm.rank for vertex in whole[number]}
    near = {number for number in whole if mine & set(whole[number])}
    assert set(mesh.cell_id.tolist()) == near and len(near) == len(mesh.cells)
    assert mesh.vertex_id[mesh.cells].tolist() == [whole[number] for number in mesh.cell_id]
    owner = {}
    for number in sorted(whole, reverse=True):
        owner.update((vertex, rank_of[number]) for vertex in whole[number])
    assert len(owner) == mesh.n_global_vertices and sum(comm.allgather(mesh.n_owned)) == len(owner)
    assert [owner[vertex] for vertex in mesh.vertex_id] == [comm.rank] * mesh.n_owned + mesh.vertex_owner.tolist()
    assert [rank_of[number] for number in mesh.cell_id] == [comm.rank] * mesh.n_owned_cells + mesh.cell_owner.tolist()
    for ids, owners, n_owned in ((mesh.cell_id, mesh.cell_owner, mesh.n_owned_cells), (mesh.vertex_id, mesh.vertex_owner, mesh.n_owned)):
        assert np.all(np.diff(ids[:n_owned]) > 0) and [*zip(owners, ids[n_owned:])] == sorted(zip(owners, ids[n_owned:]))


def check_exchange(comm, mesh):
    """Ghosts get what owners hold; owners get one from each rank that holds a vertex."""
    for exchange, ids in ((mesh.exchange, mesh.vertex_id), (mesh.cell_exchange, mesh.cell_id)):
        field = np.where(np.arange(len(ids)) < exchange.n_owned, ids, -1)[:, None].astype(float)
        exchange.bind(field).refresh()
        assert np.array_equal(field[:, 0], ids)
        held = np.ones((len(ids), 1))
        exchange.bind(held).accumulate()
        holders = np.bincount(np.concatenate(comm.allgather(ids)))
        assert np.array_equal(held[: exchange.n_owned, 0], holders[ids[: exchange.n_owned]])


def check_plex(comm, mesh):
    """PETSc's own checks hold, and its point SF leads from ghosts to the owner's point with the same id."""
    from mpi4py import MPI

    call_petsc("DMPlexCheckSymmetry", mesh.dm)
    call_petsc("DMPlexCheckSkeleton", mesh.dm, ctypes.c_int(0))
    call_petsc("DMPlexCheckPointSF", mesh.dm, ctypes.c_void_p(), ctypes.c_int(0))
    ids = np.concatenate([mesh.cell_id, mesh.vertex_id])
    forest, received = mesh.dm.getPointSF(), np.full(len(ids), -1)
    forest.bcastBegin(MPI.INT64_T, ids, received, MPI.REPLACE)
    forest.bcastEnd(MPI.INT64_T, ids, received, MPI.REPLACE)
    ghost = np.ones(len(ids), bool)
    ghost[: mesh.n_owned_cells] = False
    ghost[len(mesh.cells) : len(mesh.cells) + mesh.n_owned] = False
    assert np.array_equal(received, np.where(ghost, ids, -1))


def check_boundary(comm, mesh, expected):
    """Facets of all ranks are `expected`, a list of the vertex ids of each, none twice."""
    facets, cell = mesh.boundary()
    assert np.all(cell < mesh.n_owned_cells)
    assert sorted(facet for part in comm.allgather(mesh.vertex_id[facets].tolist()) for facet in part) == sorted(expected)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("keep", sorted(NOTCHED))
@pytest.mark.parametrize("counts", [(12, 7), (6, 5, 4)], ids=["quads", "hexahedra"])
def test_box_is_one_mesh(comm, counts, keep):
    from mpi4py import MPI

    mesh = the_box(comm, counts, keep)
    check_share(comm, mesh)
    check_exchange(comm, mesh)
    check_plex(comm, mesh)
    alone = make_box_mesh(MPI.COMM_SELF, LOWER[: mesh.dim], UPPER[: mesh.dim], counts, ALONE, NOTCHED[keep])
    check_boundary(comm, mesh, alone.vertex_id[alone.boundary()[0]].tolist())
    assert np.array_equal(mesh.points, alone.points[np.searchsorted(alone.vertex_id, mesh.vertex_id)])
    assert keep != "left" or min(comm.allgather(mesh.n_owned_cells)) == 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("kind", sorted(DIM))
def test_file_is_one_mesh(comm, kind, tmp_path_factory):
    path = the_file(comm, tmp_path_factory, kind, 4)
    from mpi4py import MPI

    mesh, alone = read_mesh(comm, path), read_mesh(MPI.COMM_SELF, path)
    check_share(comm, mesh)
    check_exchange(comm, mesh)
    check_plex(comm, mesh)
    check_boundary(comm, mesh, alone.vertex_id[alone.boundary()[0]].tolist())
    assert np.array_equal(mesh.points, alone.points[mesh.vertex_id])
    assert {number: gather(comm, mesh)[number] for number in alone.cell_id} == dict(zip(alone.cell_id, alone.cells.tolist()))
    assert list(mesh.regions) == ["left"] and np.array_equal(mesh.regions["left"], alone.regions["left"][mesh.cell_id])
    assert mesh.regions["left"].tolist() == (mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1.0).tolist()
    ends = [facet for part in comm.allgather(mesh.vertex_id[mesh.sets["end"]].tolist()) for facet in part]
    assert sorted(ends) == sorted(alone.sets["end"].tolist()) and np.all(alone.points[ends][:, :, 0] == 2.0)
    assert len(ends) == {"quad": 4, "triangle": 4, "hexahedron": 16, "tetra": 32}[kind]
    counts = comm.allgather(mesh.n_owned_cells)
    assert max(counts) <= 1.25 * np.mean(counts), "the bisection shares the cells out evenly"


@pytest.mark.mpi(min_size=2)
def test_file_with_fewer_cells_than_ranks(comm, tmp_path_factory):
    mesh = read_mesh(comm, the_file(comm, tmp_path_factory, "quad", 1))
    assert mesh.n_global_cells == 2 and mesh.n_global_vertices == 6
    check_share(comm, mesh)
    check_exchange(comm, mesh)
    check_plex(comm, mesh)


@pytest.mark.mpi(min_size=2)
def test_wrong_files_are_refused_on_every_rank(comm, tmp_path_factory):
    folder = comm.bcast(tmp_path_factory.mktemp("mesh") if comm.rank == 0 else None)
    if comm.rank == 0:
        (folder / "broken.msh").write_text("not a mesh\n")
        meshio.Mesh(np.eye(3), [("line", np.array([[0, 1]]))]).write(folder / "lines.vtk")
    comm.Barrier()
    for name, message in (("none.msh", "there is no mesh"), ("broken.msh", "cannot be read"), ("lines.vtk", "has no cells")):
        with pytest.raises(ValueError, match=message):
            read_mesh(comm, folder / name)


@pytest.mark.mpi(min_size=2)
def test_what_keep_raises_is_raised_on_every_rank(comm):
    def keep(centres):
        raise KeyError("no such region")

    partition = cell_partition(comm, [0.0, 0.0], [1.0, 1.0], (4, 4))
    with pytest.raises(KeyError, match="no such region"):
        make_box_mesh(comm, [0.0, 0.0], [1.0, 1.0], (4, 4), partition, keep if comm.rank == 1 else None)


@pytest.mark.mpi(min_size=2)
def test_partition_weighs_cells(comm):
    """The left quarter of the box has three times the work of the rest of it: weights 9 and 1."""

    def weight(centres):
        return np.where(centres[:, 0] < 0.5, 9, 1)

    partition = cell_partition(comm, [0.0, 0.0], [2.0, 1.0], (80, 40), weight)
    mesh = make_box_mesh(comm, [0.0, 0.0], [2.0, 1.0], (80, 40), partition)
    work = comm.allgather(int(weight(mesh.points[mesh.cells[: mesh.n_owned_cells]].mean(axis=1)).sum()))
    assert sum(work) == 20 * 40 * 9 + 60 * 40 and max(work) < 1.1 * sum(work) / comm.size
    planes = np.concatenate([Box.of([0.0, 0.0], [2.0, 1.0], (80, 40)).planes(axis) for axis in (0, 1)])
    assert set(partition.cut) <= set(planes), "cuts lie between layers of cells"
