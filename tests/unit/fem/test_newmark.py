import numpy as np
import pytest

from pdhpc.conditions.time_functions import Sine
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.loads import nodal_load, traction_loads
from pdhpc.fem.newmark import Newmark
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.parallel.linear_solver import Defaults
from pdhpc.study.verify.fem_dynamics import left, right
from pdhpc.study.verify.fem_problems import general_mesh, solid


def shaken(comm, dt=0.3):
    mesh = general_mesh(comm, "quad", (4, 3), 0.1)
    body, nodes = solid(mesh), Nodes(mesh, False)
    nodes.put(nodes.velocity, np.random.default_rng(0).standard_normal((nodes.n_owned, 2)))
    load = nodal_load(nodes, traction_loads(body, *right(mesh), [0.1, 0.2]), Sine(0.3, 0.4))
    motions = prescribe_on_facets(body, nodes, left(mesh), (0,), Given([0.1, 0.0], Sine(0.2)))
    return Newmark(body, nodes, NodalConditions(nodes, [load], motions), dt, Defaults("cg", 1e-13, 500, "jacobi"))


def residual(stepper):
    """M a + K u - F of free components at the present time."""
    nodes = stepper.nodes
    inner = stepper.stiffness.multiply(nodes.local(nodes.displacement)) + stepper.mass.multiply(stepper.acceleration)
    return np.where(stepper.fixed, 0.0, inner - stepper._loads(stepper.time))


def test_one_step_is_average_acceleration_in_equilibrium(comm):
    stepper = shaken(comm)
    nodes, dt, free = stepper.nodes, stepper.dt, ~stepper.fixed
    assert np.abs(residual(stepper)).max() < 1e-12
    u, v, a = nodes.owned(nodes.displacement), nodes.owned(nodes.velocity), stepper.acceleration.copy()
    stepper.advance()
    new = stepper.acceleration
    assert np.abs(residual(stepper)).max() < 1e-12 and np.abs(new - a).max() > 0.01
    assert np.allclose(nodes.owned(nodes.displacement)[free], (u + dt * v + 0.25 * dt**2 * (a + new))[free], atol=1e-14)
    assert np.allclose(nodes.owned(nodes.velocity)[free], (v + 0.5 * dt * (a + new))[free], atol=1e-14)
    assert nodes.owned(nodes.displacement)[stepper.fixed] == pytest.approx(0.1 * np.sin(2 * np.pi * 0.2 * dt))
    assert nodes.owned(nodes.velocity)[stepper.fixed] == pytest.approx(0.1 * 2 * np.pi * 0.2 * np.cos(2 * np.pi * 0.2 * dt))
    assert new[stepper.fixed] == pytest.approx(-0.1 * (2 * np.pi * 0.2) ** 2 * np.sin(2 * np.pi * 0.2 * dt), rel=0.02)  # a difference over the step


def test_state_continues_a_run(comm):
    stepper, again = shaken(comm), shaken(comm)
    for _ in range(5):
        stepper.advance()
    for key, (get, put, *_) in again.state().items():
        put(stepper.state()[key][0]())
    for each in (stepper, again):
        for _ in range(5):
            each.advance()
    assert np.array_equal(stepper.nodes.displacement, again.nodes.displacement) and again.time == stepper.time
    for name, values in stepper.ledger().items():
        assert np.array_equal(values, again.ledger()[name])
