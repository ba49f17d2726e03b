"""Scene -> finite elements whose moduli are those of the particle lattice's own bonds, without particles that move."""
import numpy as np

from pdhpc.fem.elasticity import CellMatrices, Elasticity
from pdhpc.fem.elements import ELEMENTS
from pdhpc.gfem.lattice_material import LatticeMaterial
from pdhpc.gfem.points import CellLattice
from pdhpc.scene.body import make_body
from pdhpc.scene.parts import make_part


class LatticeElasticity(Elasticity):
    """An Elasticity whose cells have the stiffness and mass that nodal quadrature over their particles gives (see gfem/lattice_material.py).

    moduli, density : means over the particles of each kind of cell, for stress and weight.
    """

    def __init__(self, mesh, kinds, kind, thickness):
        """kinds : {"stiffness", "mass", "moduli", "density"} of all kinds of cells. kind (n_cells,) int32, of each local cell. Local."""
        super().__init__(mesh, kinds["moduli"], kinds["density"], kind, thickness)
        self._kinds = kinds

    def stiffness(self):
        """Return the stiffness of the cells as CellMatrices, N/m. Local."""
        return CellMatrices.of(self._kinds["stiffness"], self.kind)

    def _scalar_mass(self):
        """Return ((n, corners, corners), kg, index): the mass matrices of one component."""
        return self._kinds["mass"], self.kind


def make_lattice_elasticity(scene, body, comm):
    """Return the LatticeElasticity of a scene on a MeshBody of a box. Collective."""
    particles = make_body(scene)
    part = make_part(scene, particles, comm, body.partition)
    lattice = CellLattice(body.mesh, part.subdomain, ELEMENTS[body.mesh.kind], scene.particles.spacing)
    material = LatticeMaterial(lattice, part.subdomain, particles.law)
    volume = lattice.ratio**scene.dim * particles.cell_volume
    own = {
        "stiffness": material.whole_stiffness,
        "mass": material.consistent,
        "moduli": material.moduli.mean(axis=1),
        "density": material.lumped.sum(axis=1) / volume,
    }
    kinds, number = _agree(comm, own)
    return LatticeElasticity(body.mesh, kinds, _of_all_cells(body.mesh, number[material.kind]), scene.thickness)


def _agree(comm, own):
    """Return (kinds of all ranks, each once and in one order; number (n,) of this rank's among them). Collective.

    own : {name: (n, ...)} of this rank's kinds; those that differ by rounding from one rank to another count as different.
    """
    shapes = {name: values.shape[1:] for name, values in own.items()}
    flat = np.concatenate([values.reshape(len(values), int(np.prod(shapes[name], dtype=int))) for name, values in own.items()], axis=1)
    rows, number = np.unique(np.concatenate(comm.allgather(flat)), axis=0, return_inverse=True)
    first = sum(comm.allgather(len(flat))[: comm.rank])
    kinds, column = {}, 0
    for name, shape in shapes.items():
        width = int(np.prod(shape, dtype=int))
        kinds[name] = rows[:, column : column + width].reshape(-1, *shape)
        column += width
    return kinds, number.ravel()[first : first + len(flat)]


def _of_all_cells(mesh, owned):
    """Return (n_cells,) int32: numbers (n_owned_cells,) of owned cells, and those that their owners have for ghosts. Collective over neighbouring ranks."""
    field = np.zeros((len(mesh.cells), 1))
    field[: mesh.n_owned_cells, 0] = owned
    bound = mesh.cell_exchange.bind(field)
    bound.refresh()
    bound.free()
    return field[:, 0].astype(np.int32)
