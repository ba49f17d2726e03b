"""Loads on particles that act through the mesh outside the patches."""
from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.conditions.loads import BodyForce
from pdhpc.conditions.time_functions import Constant
from pdhpc.gfem.loads import LoadOnLanes, ParticleLoad, sub_step_sums
from pdhpc.study.verify.case import plate, problem_of


@pytest.fixture(scope="module")
def parts():
    return problem_of('model = "gfem"\n' + plate((24, 16), extra="[mesh]\ncell_size = 4.0\n")).coupled_parts


def load_on(parts, chosen):
    """A load that grows with x + y^2 along x and is 2 along y, on particles that chosen (places) marks."""
    particles, places = parts.part.subdomain.particles, parts.part.subdomain.places()
    rows = np.flatnonzero(chosen(places))
    vector = np.stack([places[rows, 0] + places[rows, 1] ** 2, np.full(len(rows), 2.0)], axis=1)
    return ParticleLoad(parts.lattice, parts.part.subdomain, particles.slots[rows], vector, Constant()), places[rows], vector


def right_half(places):
    return places[:, 0] > 5.0  # through the middle of a column of cells


def test_nodal_forces_do_the_work_of_the_particles(parts):
    """For any bilinear displacement; here 1, x, y and x y, along both axes."""
    load, places, vector = load_on(parts, right_half)
    nodal = load.outside(parts.mesh, np.zeros(24, bool))
    for function in (lambda x: np.ones(len(x)), lambda x: x[:, 0], lambda x: x[:, 1], lambda x: x[:, 0] * x[:, 1]):
        assert function(parts.mesh.points) @ nodal == pytest.approx(function(places) @ vector, rel=1e-12, abs=1e-11), "unit volumes"
    assert len(load.cells) == 8 and np.abs(nodal[parts.mesh.points[:, 0] < 4.0]).max() == 0.0, "two columns of four cells"


def test_enriched_cells_are_left_to_their_particles(parts):
    load, places, vector = load_on(parts, right_half)
    enriched = np.zeros(24, bool)
    enriched[load.cells[:3]] = True
    inside = np.zeros(len(parts.part.subdomain.particles.position), bool)
    inside[parts.lattice.slots_of(load.cells[:3])] = True
    force = load.within(inside)
    assert load.outside(parts.mesh, enriched).sum(axis=0) + force.vector.sum(axis=0) == pytest.approx(vector.sum(axis=0), rel=1e-12)
    assert np.array_equal(force.indices, load.slots[inside[load.slots]]) and 0 < len(force.indices) < len(places)
    assert np.array_equal(load.whole().indices, load.slots) and np.array_equal(load.whole().vector, vector)
    assert not load.outside(parts.mesh, np.ones(24, bool)).any()


def test_a_load_on_nobody(parts):
    load, _, _ = load_on(parts, lambda places: places[:, 0] > 100.0)
    assert len(load.cells) == 0 and not load.outside(parts.mesh, np.zeros(24, bool)).any() and len(load.whole().indices) == 0


def test_lanes_take_the_sums_of_their_particles():
    blended = SimpleNamespace(rows=np.array([8, 24], np.int32), impulse=np.zeros((2, 2, 8)), moment=np.ones((2, 2, 8)))
    indices, vector = np.array([9, 16, 31, 40], np.int32), np.arange(8.0).reshape(4, 2) + 1.0  # 16 and 40 stand in no row of the two
    load = LoadOnLanes(BodyForce(indices, vector, Constant()), blended)
    load.add_to(blended, 0.5, 3.0)
    expected = np.zeros((2, 2, 8))
    expected[0, :, 1], expected[1, :, 7] = vector[0], vector[2]
    assert np.array_equal(blended.impulse, 0.5 * expected) and np.array_equal(blended.moment, 1.0 + 3.0 * expected)
    none = SimpleNamespace(rows=np.zeros(0, np.int32), impulse=np.zeros((0, 2, 8)), moment=np.zeros((0, 2, 8)))
    LoadOnLanes(BodyForce(indices, vector, Constant()), none).add_to(none, 0.5, 3.0)


@pytest.mark.parametrize("k", (1, 2, 5))
def test_sums_over_sub_steps_are_what_verlet_does(k):
    """A unit mass at rest under f(t): the velocity at the end is S1, the displacement S2, for any f; for f = 1 they are k tau and (k tau)^2/2."""
    tau, start = 0.3, 1.7
    function = SimpleNamespace(value=lambda t: np.cos(2.0 * t) + t * t)
    u, v = 0.0, 0.0
    for j in range(k):
        v += 0.5 * tau * function.value(start + j * tau)
        u += tau * v
        v += 0.5 * tau * function.value(start + (j + 1) * tau)
    assert sub_step_sums(function, start, tau, k) == pytest.approx((v, u), rel=1e-13)
    assert sub_step_sums(SimpleNamespace(value=lambda t: 1.0), start, tau, k) == pytest.approx((k * tau, 0.5 * (k * tau) ** 2))
