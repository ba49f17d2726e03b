"""What the mesh of this rank looks like to those who watch a run: its vertices, each once."""
import numpy as np

from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.loads import body_loads
from pdhpc.kernels.recovery import recover_strain, recover_stress
from pdhpc.output.fields import Cells


class MeshView:
    """The owned vertices of a mesh, in ascending id, with the face of peridynamics.view.View.

    Attributes
    ----------
    ids : (n,) int64. n, dim : int. volume : (n,), m^3, the integral of the vertex's hat. block : (n,) uint8, kind of the cell with the smallest id around it.
    carrier : what a point is called. cells : Cells for output.
    """

    carrier = "vertex"

    def __init__(self, body, nodes, forces):
        """body : Elasticity. nodes : Nodes. forces : function -> (n_owned, dim), N, all forces on owned vertices; maybe Collective. Collective."""
        self._body, self._nodes, self._forces = body, nodes, forces
        mesh = self._mesh = body.mesh
        self.ids, self.n, self.dim = mesh.vertex_id[: mesh.n_owned], mesh.n_owned, mesh.dim
        unit = np.zeros(mesh.dim)
        unit[0] = 1.0
        self.volume = np.ascontiguousarray(body_loads(body, nodes.stars, unit)[:, 0])
        start, cell, _ = nodes.stars
        self.block = np.minimum(body.kind[cell[start[:-1]]], 255).astype(np.uint8) if mesh.n_owned else np.zeros(0, np.uint8)
        self.cells = Cells(mesh.kind, _rows(mesh)[mesh.cells[: mesh.n_owned_cells]])
        self._corner_gradient = ELEMENTS[mesh.kind].gradient(ELEMENTS[mesh.kind].places)
        self._ghosts = nodes.exchange.bind(nodes.displacement)

    def places(self, members=slice(None)):
        """Return (n, dim) reference positions, m, of all owned vertices or of `members`. Local."""
        return self._mesh.points[: self.n][members]

    def prepare(self):
        """Bring what `field` reads up to date: displacements of ghosts. Collective over neighbours."""
        self._ghosts.refresh()

    def field(self, name):
        """Return a field of all owned vertices. Collective over neighbours for "force_density", else Local.

        displacement, velocity : (n, dim), m, m/s. strain, stress : (n, dim, dim), 1, Pa, averages over the cells around a vertex of what they have there.
        strain_energy_density : (n,), J/m^3, of these. force_density : (n, dim), N/m^3, all forces on a vertex over its volume. damage, precrack,
        active : (n,), 0.
        """
        nodes, dim = self._nodes, self.dim
        if name in ("displacement", "velocity"):
            return nodes.owned(getattr(nodes, name))[:, :dim]
        if name == "strain":
            return self._strain()
        if name == "stress":
            return self._stress()
        if name == "strain_energy_density":
            return 0.5 * np.einsum("nab,nab->n", self._stress(), self._strain())
        if name == "force_density":
            return self._forces() / self.volume[:, None]
        if name in ("damage", "precrack", "active"):
            return np.zeros(self.n)
        raise KeyError(name)

    def _recovery(self):
        mesh, nodes = self._mesh, self._nodes
        displacement = np.ascontiguousarray(nodes.local(nodes.displacement)[:, : self.dim])
        return (mesh.points, mesh.cells, self._corner_gradient, displacement, tuple(nodes.stars)), np.empty((self.n, self.dim, self.dim))

    def _strain(self):
        if self._body.basis.functions > 1:
            return self._slopes()
        arguments, result = self._recovery()
        recover_strain(*arguments, result)
        return result

    def _stress(self):
        if self._body.basis.functions > 1:
            return np.einsum("nabcd,ncd->nab", self._body.tensors[self.block], self._slopes())
        arguments, result = self._recovery()
        recover_stress(*arguments, np.ascontiguousarray(self._body.tensors), self._body.kind, result)
        return result

    def _slopes(self):
        """Return (n, dim, dim), strains of a flat-top basis, which carries the slopes h_k du_a/dx_k at vertices itself."""
        unknowns = self._nodes.owned(self._nodes.displacement).reshape(self.n, -1, self.dim)
        gradient = (unknowns[:, 1:, :] / np.asarray(self._mesh.cell_size)[:, None]).transpose(0, 2, 1)
        return 0.5 * (gradient + gradient.transpose(0, 2, 1))

    def first_not_finite(self):
        """Return (id, place) of the first vertex whose displacement is NaN or infinite, None without any. Local."""
        bad = np.flatnonzero(~np.isfinite(self._nodes.owned(self._nodes.displacement)).all(axis=1))
        return None if len(bad) == 0 else (int(self.ids[bad[0]]), tuple(float(x) for x in self.places(bad[0])))

    def foremost(self, members, ahead, threshold):
        """Return -1: nothing breaks in a mesh."""
        return -1

    def directed_bonds(self):
        """Return 0: there are no bonds."""
        return 0

    def broken(self):
        """Return 0: nothing breaks in a mesh."""
        return 0


def _rows(mesh):
    """Return (n_vertices,) int64: the row of each local vertex in files, where ranks follow each other. Collective."""
    first = sum(mesh.comm.allgather(mesh.n_owned)[: mesh.comm.rank])
    row = np.zeros((len(mesh.points), 1))
    row[: mesh.n_owned, 0] = np.arange(first, first + mesh.n_owned)
    bound = mesh.exchange.bind(row)
    bound.refresh()
    bound.free()
    return row[:, 0].astype(np.int64)
