import numpy as np
import pytest

from pdhpc.conditions.time_functions import Sine
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.explicit import Explicit
from pdhpc.fem.loads import facets_where, nodal_load, traction_loads
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.fem.vertex_matrix import VertexMatrix
from pdhpc.study.verify.fem_dynamics import left, massive_nodes
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, solid

MAKE = {"stencil": lambda comm: box_mesh(comm, (5, 4)), "cells": lambda comm: general_mesh(comm, "triangle", (5, 4), 0.2)}


def problem(comm, path, moved=True):
    body = solid(MAKE[path](comm))
    nodes, sweep = massive_nodes(body)
    load = nodal_load(nodes, traction_loads(body, *facets_where(body.mesh, lambda x, n: n[:, 0] > 0.9), [0.1, 0.2]), Sine(0.3, 0.4))
    motions = prescribe_on_facets(body, nodes, left(body.mesh), (0, 1), Given([0.1, 0.05], Sine(0.5))) if moved else []
    nodes.put(nodes.velocity, np.random.default_rng(0).standard_normal((nodes.n_owned, 2)))
    return body, Explicit(nodes, sweep, NodalConditions(nodes, [load], motions), 0.03)


@pytest.mark.parametrize("path", MAKE)
def test_one_step_is_the_formula(comm, path):
    body, stepper = problem(comm, path, moved=False)
    nodes, dt = stepper.nodes, stepper.dt
    assert stepper.internal.sweep.name == path
    stiffness, mass = VertexMatrix(body.mesh, nodes.stars, 2, (1.0, body.stiffness())), nodes.owned(nodes.mass)[:, None]
    load = nodes.owned(nodes.force) / np.sin(0.4)  # at rest: the force is the load alone
    u, v = nodes.owned(nodes.displacement), nodes.owned(nodes.velocity)
    half = v + 0.5 * dt * nodes.owned(nodes.force) / mass
    new = u + dt * half
    force = load * np.sin(2 * np.pi * 0.3 * dt + 0.4) - stiffness.multiply(new)
    stepper.advance()
    assert np.allclose(nodes.owned(nodes.displacement), new, rtol=1e-14, atol=1e-15)
    assert np.allclose(nodes.owned(nodes.velocity), half + 0.5 * dt * force / mass, rtol=1e-12)
    assert stepper.time == dt and stepper.step == 1 and stepper.broken == 0 and stepper.bond_evaluations == {} and stepper.bytes_sent == 0


@pytest.mark.parametrize("path", MAKE)
def test_state_continues_a_run_bit_for_bit(comm, path):
    _, stepper = problem(comm, path)
    for _ in range(20):
        stepper.advance()
    saved = {key: np.copy(get()) for key, (get, put, *_) in stepper.state().items()}
    for _ in range(20):
        stepper.advance()
    _, again = problem(comm, path)
    for key, (get, put, *_) in again.state().items():
        put(saved[key])
    again.resume()
    for _ in range(20):
        again.advance()
    for name in ("displacement", "velocity"):
        assert np.array_equal(getattr(again.nodes, name), getattr(stepper.nodes, name))
    assert np.array_equal(again.ledger()["external_work"], stepper.ledger()["external_work"])


@pytest.mark.parametrize("path", MAKE)
def test_ledger_is_energies(comm, path):
    body, stepper = problem(comm, path)
    for _ in range(10):
        stepper.advance()
    nodes, ledger = stepper.nodes, stepper.ledger()
    u = nodes.local(nodes.displacement)
    assert ledger["strain_energy"].sum() == pytest.approx(0.5 * (u * VertexMatrix(body.mesh, nodes.stars, 2, (1.0, body.stiffness())).multiply(u)).sum())
    assert ledger["kinetic_energy"].sum() == pytest.approx(0.5 * (nodes.mass[:, None] * nodes.velocity**2).sum())
    assert not ledger["dissipated_energy"].any() and ledger["external_work"].any()
    assert set(stepper.seconds) == {"force", "exchange", "wait", "integrate"} and stepper.seconds["force"] > 0
