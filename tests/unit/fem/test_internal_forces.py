import numpy as np
import pytest

from pdhpc.fem import internal_forces
from pdhpc.fem.elasticity import Elasticity
from pdhpc.fem.internal_forces import CellSweep, InternalForces, make_sweep
from pdhpc.fem.moduli import isotropic
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.vertex_matrix import VertexMatrix
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.fem_problems import DIMENSION, box_mesh, general_mesh, linear_field, solid


def hole(x):
    return (np.abs(x - 0.4) > 0.15).any(axis=1)


def shaken(mesh):
    nodes = Nodes(mesh)
    nodes.put(nodes.displacement, noise(mesh.vertex_id[: mesh.n_owned], mesh.dim))
    return nodes


@pytest.mark.parametrize("counts", ((9, 14), (5, 9, 7)))
def test_stencils_do_what_cells_do(comm, counts):
    """Two kinds of cells and a hole: both ways give the product with the assembled matrix."""
    mesh = box_mesh(comm, counts, keep=hole)
    kind = (mesh.points[mesh.cells].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
    body = Elasticity(mesh, [isotropic(e, nu, DIMENSION[mesh.dim]) for e, nu in ((1.0, 0.3), (3.0, 0.1))], 1.0, kind)
    nodes, matrices = shaken(mesh), body.stiffness()
    stencil, cells = make_sweep(nodes, matrices), CellSweep(nodes, matrices)
    assert stencil.name == "stencil" and cells.name == "cells"
    found = []
    for sweep in (stencil, cells):
        forces = InternalForces(nodes, sweep, force=nodes.new_field())
        forces.evaluate()
        found.append(nodes.owned(forces.force))
    exact = -VertexMatrix(mesh, nodes.stars, mesh.dim, (1.0, matrices)).multiply(nodes.local(nodes.displacement))
    assert np.allclose(found[0], exact, atol=1e-13) and np.allclose(found[1], exact, atol=1e-13)
    assert set(forces.seconds) == {"force", "exchange", "wait"} and forces.bytes_sent == 0
    forces.refresh()
    forces.free()


def test_too_many_surroundings_go_cell_by_cell(comm, monkeypatch):
    mesh = box_mesh(comm, (6, 6))
    nodes, matrices = shaken(mesh), solid(mesh).stiffness()
    monkeypatch.setattr(internal_forces, "MOST_STENCILS", 8)  # a box has nine: its inside, sides and corners
    assert make_sweep(nodes, matrices).name == "cells"
    monkeypatch.setattr(internal_forces, "MOST_STENCILS", 9)
    assert make_sweep(nodes, matrices).name == "stencil"


@pytest.mark.parametrize("kind, counts", (("triangle", (5, 4)), ("hexahedron", (3, 3, 2))))
def test_uniform_strain_is_in_equilibrium_inside(comm, kind, counts):
    mesh = general_mesh(comm, kind, counts, 0.2)
    nodes = Nodes(mesh)
    nodes.put(nodes.displacement, linear_field(mesh.dim).displacement(mesh.points))
    InternalForces(nodes, make_sweep(nodes, solid(mesh).stiffness())).evaluate()
    inside = ((mesh.points > 1e-9) & (mesh.points < np.array([1.0, 1.2, 0.8])[: mesh.dim] - 1e-9)).all(axis=1)
    force = nodes.owned(nodes.force)
    assert np.abs(force[inside]).max() < 1e-14 and np.abs(force[~inside]).max() > 1e-3
    assert np.abs(force.sum(axis=0)).max() < 1e-13
