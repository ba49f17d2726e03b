import numpy as np
import pytest

from pdhpc.conditions.impactors import CYLINDER, PLANE, SPHERE
from pdhpc.kernels import impact as kernels
from pdhpc.kernels.impact import Rigid, Struck

AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
CENTRE = np.array([0.2, -0.1, 0.3])


def rigid(kind, half_length=np.inf, friction=0.0, velocity=(0.0, 0.0, 0.0)):
    return Rigid(kind, CENTRE, AXIS, np.array(velocity), 0.8, half_length, friction, 0.01)


def distances(body, x):
    """Return the distances of points from the surface by their coordinates along and across the axis."""
    offset = x - CENTRE
    along = offset @ AXIS
    across = np.linalg.norm(offset - along[:, None] * AXIS, axis=1)
    if body.kind == PLANE:
        return along
    if body.kind == SPHERE:
        return np.linalg.norm(offset, axis=1) - 0.8
    side, end = across - 0.8, np.abs(along) - body.half_length
    outside = np.hypot(np.maximum(side, 0), np.maximum(end, 0))
    return np.where(outside > 0, outside, np.maximum(side, end))


BODIES = [rigid(SPHERE), rigid(PLANE), rigid(CYLINDER), rigid(CYLINDER, 0.5)]


def struck_by(n):
    random = np.random.default_rng(2)
    return Struck(np.arange(n, dtype=np.int32), np.full(n, 0.25), random.uniform(0.5, 1.5, n), random.uniform(1, 2, n), random.uniform(3, 4, n))


def pushed(body, x, v):
    n = len(x)
    struck, density, applied, inelastic = struck_by(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    kernels.push(body, struck, x, v, density, applied, inelastic, False)
    return struck, density, applied, inelastic


@pytest.mark.parametrize("body", BODIES, ids=["sphere", "plane", "infinite", "finite"])
def test_force_is_minus_the_gradient_of_the_stored_energy(body):
    x = np.random.default_rng(1).uniform(-1.5, 1.5, (400, 3))
    struck, density, applied, _ = pushed(body, x, np.zeros((400, 3)))

    def energy(points):
        result = np.empty(len(points))
        kernels.stored(body, struck, points, 3, result)
        return result

    depth = np.maximum(0.0, 0.25 - distances(body, x))
    assert np.allclose(energy(x), 0.5 * struck.volume * struck.stiffness * depth**2, atol=1e-13)
    assert (depth > 0).sum() > 30 and np.allclose(np.linalg.norm(applied, axis=1), struck.volume * struck.stiffness * depth)
    step = 1e-6 * np.eye(3)
    gradient = np.stack([(energy(x + h) - energy(x - h)) / 2e-6 for h in step], axis=1)
    smooth = np.abs(np.linalg.norm(gradient, axis=1) - np.linalg.norm(applied, axis=1)) < 1e-6  # not where two surfaces of a cylinder are equally near
    assert smooth.mean() > 0.98 and np.allclose(applied[smooth], -gradient[smooth], atol=1e-6)
    assert np.allclose(density * struck.volume[:, None], applied)
    near = np.empty(400, np.bool_)
    kernels.find_near(body, x, 3, struck.slot, struck.radius, 0.1, near)
    assert np.array_equal(near, distances(body, x) < 0.35)


def test_friction_opposes_the_sliding():
    body = rigid(PLANE, friction=0.3, velocity=(0.5, 0.0, 0.0))
    x = CENTRE - 0.1 * np.array([[1.0], [2.0]]) * AXIS
    v = np.array([[0.5, 2.0, 1.0], [0.5, 0.0, 0.0]])  # the second moves with the plane
    struck, _, applied, inelastic = pushed(body, x, v)
    normal = struck.volume * struck.stiffness * np.array([0.35, 0.45])
    slip = v[0] - [0.5, 0.0, 0.0]
    slip = slip - (slip @ AXIS) * AXIS
    assert np.allclose(inelastic[0], -0.3 * normal[0] * slip / np.linalg.norm(slip)) and not inelastic[1].any()
    assert np.allclose(applied, normal[:, None] * AXIS + inelastic)
    given = np.array(inelastic)
    kernels.push(body, struck, x, np.zeros((2, 3)), np.zeros((2, 3)), applied, given, True)
    assert np.array_equal(given, inelastic)
    work, loss = np.zeros(2), np.zeros(2)
    kernels.account(struck, np.arange(2), applied, inelastic, v, body.velocity, 0.5, True, work, loss)
    assert np.allclose(loss[0], 0.5 * 0.3 * normal[0] * np.linalg.norm(slip)) and loss[1] == 0.0
    assert np.allclose(work, 0.5 * 0.5 * applied[:, 0])


def test_the_reaction_is_minus_the_sum():
    x = CENTRE - np.random.default_rng(4).uniform(-0.5, 0.4, (50, 1)) * AXIS
    struck, _, applied, _ = pushed(rigid(PLANE), x, np.zeros((50, 3)))
    places = np.zeros((4, 21), np.int64)
    kernels.add_reaction(struck, applied, places)
    weights = 2.0 ** (32 * np.arange(20.0) - 320)
    assert np.allclose(places[:3, :20] @ weights, -applied.sum(axis=0))
    touched = np.abs(applied).any(axis=1)
    assert np.isclose(places[3, :20] @ weights, (struck.volume * struck.stiffness)[touched].sum()) and 0 < touched.sum() < 50
