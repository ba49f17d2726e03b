import math

import numpy as np
import pytest

from pdhpc.fem.critical_step import bound_of_cells, critical_step, estimate_step
from pdhpc.fem.internal_forces import InternalForces, make_sweep
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.vertex_matrix import VertexMatrix
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, solid


@pytest.mark.parametrize("make", (lambda comm: box_mesh(comm, (5, 4)), lambda comm: general_mesh(comm, "triangle", (5, 4), 0.2)))
def test_the_estimate_is_the_largest_frequency_and_the_bound_lies_below(comm, make):
    mesh = make(comm)
    body, nodes = solid(mesh), Nodes(mesh)
    nodes.set_mass(body.lumped_mass(nodes.stars))
    stiffness = VertexMatrix(mesh, nodes.stars, 2, (1.0, body.stiffness()))
    n = len(mesh.points)
    dense = np.stack([stiffness.multiply(column.reshape(n, 2)).ravel() for column in np.eye(2 * n)], axis=1)
    root = 1 / np.sqrt(np.repeat(nodes.owned(nodes.mass), 2))
    exact = 2 / math.sqrt(np.linalg.eigvalsh(root[:, None] * dense * root)[-1])
    forces = InternalForces(nodes, make_sweep(nodes, body.stiffness()), nodes.new_field(), nodes.new_field())
    estimate, change = estimate_step(nodes, forces)
    assert exact * (1 - 1e-12) <= estimate < 1.005 * exact and change < 1e-3
    bound = bound_of_cells(body, body.stiffness())
    assert 0.3 * exact < bound <= exact
    assert max(bound, 0.97 * exact) <= critical_step(body, body.stiffness(), nodes, forces) < exact
