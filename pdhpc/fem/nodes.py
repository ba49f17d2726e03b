"""The vertices of one rank as carriers of fields: where each lies in arrays by slot, and what they hold.

On a box of cells slots are a grid, padded, whose fastest axis is the longest one of the rank's share, so that neighbours lie next to each other;
on other meshes slots are the local numbers of vertices. Arrays hold a component of all slots together.
"""
import numpy as np

from pdhpc.fem.elements import ELEMENTS
from pdhpc.kernels import cells as loops
from pdhpc.kernels.simd import LANES
from pdhpc.parallel.ghosts import GhostExchange
from pdhpc.state import Entry


class Stars(tuple):
    """(start (n_owned + 1,), cell, corner): the cells around each owned vertex in ascending id, and which of their corners it is."""


class Nodes:
    """Fields of the vertices of a mesh.

    Attributes
    ----------
    mesh : Mesh. dim : int. n_owned : int. slots (n_vertices,) int32 : where each local vertex lies. n_slots : a multiple of 8.
    width : unknowns per vertex, dim with hats.
    displacement, velocity, force (n_slots, width), m, m/s, N : views of component by component storage. mass (n_slots,), kg, lumped; 0 at ghosts and where
    no vertex is.
    exchange : GhostExchange of slots. stride (dim,) int64 : slots from a vertex to the next along each axis of a grid, else None.
    """

    def __init__(self, mesh, grid=None, width=None):
        """grid : whether slots are a grid (default: on boxes). width : unknowns per vertex (default: dim). Collective over the mesh's ranks."""
        self.mesh, self.dim, self.n_owned, self.width = mesh, mesh.dim, mesh.n_owned, mesh.dim if width is None else width
        grid = mesh.cell_size is not None if grid is None else grid
        if grid:
            self.slots, self.n_slots, self.stride = _grid_of(mesh)
            slots, ghosts = self.slots[: self.n_owned], self.slots[self.n_owned :]
            ids, owners = mesh.vertex_id, mesh.vertex_owner
            self.exchange = GhostExchange(mesh.comm, ids[: self.n_owned], ids[self.n_owned :], owners, slots, ghosts)
        else:
            self.slots, self.stride, self.exchange = np.arange(len(mesh.points), dtype=np.int32), None, mesh.exchange
            self.n_slots = -(-len(mesh.points) // LANES) * LANES
        self.displacement, self.velocity, self.force = (self.new_field() for _ in range(3))
        self.mass = np.zeros(self.n_slots)
        self.stars = stars_of(mesh)

    def new_field(self, width=None):
        """Return zeros (n_slots, width), a view of component by component storage. Local."""
        return np.zeros((self.width if width is None else width, self.n_slots)).T

    @property
    def ids(self):
        """(n_owned,) int64, global ids of the owned vertices, ascending."""
        return self.mesh.vertex_id[: self.n_owned]

    @property
    def owned_slots(self):
        """(n_owned,) int32, slots of the owned vertices in ascending id."""
        return self.slots[: self.n_owned]

    def set_mass(self, mass):
        """Take the lumped masses (n_owned,), kg, of the owned vertices. Local."""
        self.put(self.mass, mass)

    def owned(self, field):
        """Return the rows of a field by slot that belong to owned vertices, in ascending id: a copy. Local."""
        return field[self.owned_slots]

    def put(self, field, values):
        """Store values (n_owned, ...) of owned vertices, in ascending id, in a field by slot. Local."""
        field[self.owned_slots] = values

    def entry(self, field):
        """Return the Entry of a field by slot: its owned rows. Local."""
        return Entry(lambda: self.owned(field), lambda values: self.put(field, values), self.ids)

    def local(self, field):
        """Return (n_vertices, ...): the rows of a field by slot of all local vertices, as the mesh numbers them: a copy. Local."""
        return field[self.slots]


def stars_of(mesh):
    """Return Stars of a mesh: of owned vertices, cells in ascending global id. Local."""
    order = np.argsort(mesh.cell_id, kind="stable")
    size = int((mesh.cells < mesh.n_owned).sum())
    start, cell, corner = np.zeros(mesh.n_owned + 1, np.int64), np.empty(size, np.int32), np.empty(size, np.int8)
    loops.stars(mesh.cells, order, mesh.n_owned, start, cell, corner)
    return Stars((start, cell, corner))


def _grid_of(mesh):
    """Return (slots (n_vertices,) int32, n_slots, stride (dim,)) of a grid over the local vertices of a box of cells."""
    places = ELEMENTS[mesh.kind].places.astype(np.int64)
    index = np.zeros((len(mesh.points), mesh.dim), np.int64)
    cell_index = mesh.index
    for corner, place in enumerate(places):
        index[mesh.cells[:, corner]] = cell_index + place
    index -= index.min(axis=0, initial=np.iinfo(np.int64).max) if len(index) else 0
    shape = index.max(axis=0, initial=0) + 1
    order = np.argsort(shape, kind="stable")  # the longest axis last
    stride, size = np.empty(mesh.dim, np.int64), 1
    for rank, axis in enumerate(order[::-1]):
        stride[axis] = size
        size *= _pitch(shape[axis]) if rank == 0 else shape[axis]
    slack = -(-(int(stride.sum()) + LANES) // LANES) * LANES
    slots = (index @ stride + slack).astype(np.int32)
    return slots, -(-(int(size) + 2 * slack) // LANES) * LANES, stride


def _pitch(count):
    """Return an odd multiple of 8 that is at least `count`: rows start aligned and do not fall into the same sets of the cache."""
    blocks = -(-int(count) // LANES)
    return LANES * (blocks + 1 - blocks % 2)
