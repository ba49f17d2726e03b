import numpy as np
import pytest

from pdhpc.conditions.time_functions import Ramp
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.loads import facets_where, nodal_load, traction_loads
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.static import Static
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.parallel.linear_solver import Defaults, SolverError
from pdhpc.study.verify.fem_dynamics import left, right, totals
from pdhpc.study.verify.fem_problems import box_mesh, solid


def pulled(comm, basis=None, motions=True, defaults=None):
    """A bar of length 2 and E = 1 without lateral contraction, pulled by 0.1 Pa over two steps."""
    mesh = box_mesh(comm, (4, 2), (2.0, 0.5))
    body = solid(mesh, 0.0, basis=basis)
    nodes = Nodes(mesh, False, body.width)
    load = nodal_load(nodes, traction_loads(body, *right(mesh), [0.1, 0.0]), Ramp(0.0, 2.0))
    held = prescribe_on_facets(body, nodes, left(mesh), (0, 1), Given([0.0, 0.0], Ramp(0.0, 1.0))) if motions else []
    return Static(body, nodes, NodalConditions(nodes, [load], held), 1.0, *([defaults] if defaults else []))


@pytest.mark.parametrize("basis", (None, FlatTop("quad")))
def test_a_bar_is_stretched_by_its_stress_over_its_modulus(comm, basis):
    problem = pulled(comm, basis)
    for step, factor in ((1, 0.5), (2, 1.0)):
        problem.advance()
        u = problem.nodes.owned(problem.nodes.displacement)
        assert problem.step == step and problem.time == step
        assert u[:, 0] == pytest.approx(0.1 * factor * problem.body.mesh.points[:, 0], abs=1e-12) and np.abs(u[:, 1]).max() < 1e-12
        ledger = totals(comm, problem)
        assert ledger["strain_energy"] == pytest.approx(0.5 * 0.01 * factor**2 * 1.0) and ledger["external_work"] == pytest.approx(ledger["strain_energy"])
        assert ledger["kinetic_energy"] == 0.0
    assert problem.iterations > 0 and problem.seconds["assemble"] > 0


def test_state_continues(comm):
    problem, again = pulled(comm), pulled(comm)
    problem.advance()
    for key, (get, put, *_) in again.state().items():
        put(problem.state()[key][0]())
    for each in (problem, again):
        each.advance()
    assert np.array_equal(problem.nodes.displacement, again.nodes.displacement)
    assert totals(comm, problem) == totals(comm, again)


def test_what_does_not_converge_is_an_error(comm):
    with pytest.raises(SolverError, match="gfem_ did not converge in 1 iterations"):
        pulled(comm, defaults=Defaults("cg", 1e-12, 1, "jacobi")).advance()
