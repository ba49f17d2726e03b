import numpy as np
import pytest

from pdhpc.conditions.time_functions import Ramp
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.implicit import Implicit, refreshed
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.study.verify.fem_dynamics import left
from pdhpc.study.verify.fem_problems import box_mesh, solid


class Still(Implicit):
    """Steps that do nothing but move what is prescribed."""

    def _advance(self, t):
        before = self.nodes.owned(self.nodes.displacement)
        self.nodes.put(self.nodes.displacement, self._targets(t))
        self._account(self._loads(t), np.full((self.nodes.n_owned, 2), 2.0), self.nodes.owned(self.nodes.displacement) - before)


@pytest.mark.parametrize("quantity", ("displacement", "velocity"))
def test_prescribed_components_move_and_their_forces_work(comm, quantity):
    mesh = box_mesh(comm, (2, 1))
    body, nodes = solid(mesh), Nodes(mesh, False)
    motions = prescribe_on_facets(body, nodes, left(mesh), [0], Given([0.5, 9.0], Ramp(0.0, 1.0)), quantity)
    stepper = Still(body, nodes, NodalConditions(nodes, [], motions), 0.5)
    nodes.velocity[...] = 7.0
    for moved in (0.25, 0.5) if quantity == "displacement" else (0.5 * 0.5 * 0.25, 0.5 * 0.5 * (0.25 + 0.75)):
        stepper.advance()
        u = nodes.owned(nodes.displacement)
        assert np.allclose(u[mesh.points[:, 0] == 0], [moved, 0.0]) and not u[mesh.points[:, 0] > 0].any()
    assert (nodes.velocity == 7.0).all() and stepper.time == 1.0
    first = 0.25 if quantity == "displacement" else 0.0625  # the force grows from 0 to 2 N over the first step; there are two vertices
    assert stepper._work.sum() == pytest.approx(2 * (0.5 * 2.0 * first + 2.0 * (moved - first)))
    assert set(stepper.state()) == {"displacement", "velocity", "work", "applied", "step", "iterations"} and stepper.bond_evaluations == {}


def test_refreshed_fields_are_in_the_order_of_vertices(comm):
    nodes = Nodes(box_mesh(comm, (2, 1)))
    nodes.put(nodes.velocity, np.arange(12.0).reshape(6, 2))
    assert refreshed(nodes, nodes.velocity).tolist() == np.arange(12.0).reshape(6, 2).tolist()
