"""Internal forces -K u of owned vertices, summed over all cells around each in ascending id: the same bits on any number of ranks.

On a box of cells with few different surroundings of vertices a stencil of assembled blocks does it; elsewhere cells are multiplied one by one and vertices
gather. All ranks agree on which of the two it is. What needs no ghost is done while messages travel.
"""
import time

import numpy as np

from pdhpc.fem.elements import ELEMENTS
from pdhpc.kernels import cells as loops
from pdhpc.kernels.simd import LANES
from pdhpc.kernels.vertex_stencil import Runs, stencil_forces
from pdhpc.parallel.comm import largest

MOST_STENCILS = 1024
"""Different surroundings of vertices up to which a box uses stencils: 2 MB of coefficients in 3D."""


def make_sweep(nodes, matrices):
    """Return what computes -K u of owned vertices: StencilSweep or CellSweep. Collective over the mesh's ranks.

    nodes : Nodes. matrices : CellMatrices with nodes.dim unknowns per vertex.
    """
    if nodes.stride is not None:
        surroundings = _surroundings(nodes, matrices)
        if surroundings is not None:
            return StencilSweep(nodes, matrices, *surroundings)
    return CellSweep(nodes, matrices)


def _surroundings(nodes, matrices):
    """Return (codes of all ranks, ascending; code (n_owned,)): which matrix stands at each corner of a vertex, as digits.

    None if there are too many. Collective.
    """
    mesh, corners = nodes.mesh, nodes.mesh.cells.shape[1]
    digits = int(largest(mesh.comm, len(matrices.table))) + 1
    few = digits**corners < 2**62
    code = np.zeros(nodes.n_owned, np.int64)
    if few:
        start, cell, corner = nodes.stars
        vertex = np.repeat(np.arange(nodes.n_owned), np.diff(start))
        np.add.at(code, vertex, (matrices.index[cell].astype(np.int64) + 1) * digits ** corner.astype(np.int64))
    own = np.unique(code)
    few = few and len(own) <= MOST_STENCILS
    everyone = mesh.comm.allgather(own if few else None)
    if any(each is None for each in everyone):
        return None
    codes = np.unique(np.concatenate(everyone))
    return (codes, code, digits) if len(codes) <= MOST_STENCILS else None


class StencilSweep:
    """-K u by stencils: see kernels/vertex_stencil.py. name : "stencil"."""

    name = "stencil"

    def __init__(self, nodes, matrices, codes, code, digits):
        """codes (n,), code (n_owned,) int64: surroundings of vertices as digits of base `digits`, those of all ranks and this rank's. Local."""
        places = ELEMENTS[nodes.mesh.kind].places.astype(np.int64)
        used = np.unique(code)
        self._offset, self._coefficient = _assemble_stencils(used, digits, matrices.matrices, places, nodes.stride)
        row = np.searchsorted(used, code)
        ghost = nodes.mesh.cells >= nodes.n_owned
        start, cell, _ = nodes.stars
        border = np.zeros(nodes.n_owned, bool)
        if len(cell):
            border = np.add.reduceat(ghost.any(axis=1)[cell], start[:-1]) > 0
        self._runs = [_runs_of(nodes.owned_slots[chosen], row[chosen]) for chosen in (~border, border)]
        self._spare = np.empty((nodes.dim, LANES))

    def inner(self, field, force):
        """Store the forces of vertices that need no ghost; field, force (n_slots, dim). Local."""
        stencil_forces(field.T, self._runs[0], self._offset, self._coefficient, self._spare, force.T)

    def border(self, field, force):
        """Store the other forces. Local."""
        stencil_forces(field.T, self._runs[1], self._offset, self._coefficient, self._spare, force.T)


def _assemble_stencils(codes, digits, matrices, places, stride):
    """Return (offset (3^dim,), coefficient (n, 3^dim, dim, dim)): -K of a vertex to each vertex around it, of each surrounding, cells in ascending id."""
    dim = places.shape[1]
    steps = np.stack([each.ravel() for each in np.meshgrid(*[[-1, 0, 1]] * dim, indexing="ij")], axis=1)
    number = 3 ** np.arange(dim - 1, -1, -1)
    blocks = matrices.reshape(len(matrices), len(places), dim, len(places), dim)
    coefficient = np.zeros((len(codes), len(steps), dim, dim))
    for corner in np.lexsort((-places).T[::-1]):  # the cell of which the vertex is the highest corner has the smallest id
        kind = codes // digits**corner % digits - 1
        there = kind >= 0
        for other, place in enumerate(places):
            step = (place - places[corner] + 1) @ number
            coefficient[there, step] -= blocks[kind[there], corner, :, other, :]
    return steps @ stride, coefficient


def _runs_of(slots, row):
    """Return Runs of vertices: slots next to each other of the same row of stencils."""
    order = np.argsort(slots, kind="stable")
    slots, row = slots[order].astype(np.int64), row[order].astype(np.int64)
    new = np.ones(len(slots), bool)
    new[1:] = (np.diff(slots) != 1) | (np.diff(row) != 0)
    first = np.flatnonzero(new)
    return Runs(slots[first], np.diff(np.append(first, len(slots))), row[first])


class CellSweep:
    """-K u cell by cell, then gathered. name : "cells". forces (n_cells, padded), N: K u of each local cell, after a sweep."""

    name = "cells"

    def __init__(self, nodes, matrices):
        self._nodes, self._matrices = nodes, matrices
        ghost = (nodes.mesh.cells >= nodes.n_owned).any(axis=1)
        self._inner, self._border = (np.flatnonzero(chosen).astype(np.int32) for chosen in (~ghost, ghost))
        self.forces = np.zeros((len(nodes.mesh.cells), matrices.table.shape[2]))

    def inner(self, field, force):
        """Multiply the cells that need no ghost; field (n_slots, dim). Local."""
        self._multiply(field, self._inner)

    def border(self, field, force):
        """Multiply the other cells and store the forces of all owned vertices in force (n_slots, dim). Local."""
        self._multiply(field, self._border)
        loops.gather(*self._nodes.stars, self.forces, self._nodes.slots, -1.0, force)

    def _multiply(self, field, chosen):
        loops.cell_forces(self._nodes.mesh.cells, self._nodes.slots, self._matrices.index, self._matrices.table, field, chosen, self.forces)


class InternalForces:
    """force = -K field, ghosts of the field refreshed on the way.

    seconds : {"force", "exchange", "wait"}: in sweeps, packing and posting messages, and waiting for them.
    """

    def __init__(self, nodes, sweep, field=None, force=None):
        """field, force (n_slots, dim): displacement and force of the nodes without. Local."""
        self.nodes, self.sweep = nodes, sweep
        self.field = nodes.displacement if field is None else field
        self.force = nodes.force if force is None else force
        self.seconds = {"force": 0.0, "exchange": 0.0, "wait": 0.0}
        self._ghosts = nodes.exchange.bind(self.field)

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per evaluation."""
        return self._ghosts.bytes_sent

    def evaluate(self):
        """Store the forces on owned vertices. Collective over neighbouring ranks."""
        times = [time.perf_counter()]
        self._ghosts.start_refresh()
        times.append(time.perf_counter())
        self.sweep.inner(self.field, self.force)
        times.append(time.perf_counter())
        self._ghosts.finish_refresh()
        times.append(time.perf_counter())
        self.sweep.border(self.field, self.force)
        times.append(time.perf_counter())
        for name, start in (("exchange", 0), ("force", 1), ("wait", 2), ("force", 3)):
            self.seconds[name] += times[start + 1] - times[start]

    def refresh(self):
        """Bring ghosts of the field up to date. Collective over neighbouring ranks."""
        self._ghosts.refresh()

    def free(self):
        """Release the messages. Local."""
        self._ghosts.free()
