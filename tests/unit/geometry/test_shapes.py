import numpy as np
import pytest

from pdhpc.geometry.shapes import Band, Beyond, Bonded, Box, Cylinder, Disk, Everywhere, HalfSpace, Sphere, Within

P = np.array


@pytest.mark.parametrize("shape, inside, outside", [
    (Box((0.0, 0.0), (1.0, 2.0)), [[0.5, 1.0], [0.0, 0.0], [1.0, 2.0]], [[1.01, 1.0], [0.5, -0.01]]),
    (Disk((1.0, 1.0), 0.5), [[1.0, 1.0], [1.5, 1.0]], [[1.4, 1.4]]),
    (Sphere((0.0, 0.0, 0.0), 1.0), [[0.5, 0.5, 0.5], [0.0, 0.0, -1.0]], [[0.6, 0.6, 0.6]]),
    (Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), 1.0), [[0.9, 0.0, 2.0], [0.0, 0.0, 0.0]], [[0.8, 0.8, 1.0], [0.0, 0.0, 2.1], [0.0, 0.0, -0.1]]),
    (Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), 1.0, 0.5), [[0.9, 0.0, 2.0], [0.0, 0.5, 0.0], [0.4, 0.4, 1.0]], [[0.8, 0.8, 1.0], [0.0, 0.0, 1.0], [0.3, 0.3, 0.0], [0.9, 0.0, 2.1]]),
    (HalfSpace((1.0, 0.0), (2.0, 0.0)), [[1.0, 5.0], [3.0, -1.0]], [[0.99, 0.0]]),
])
def test_contains(shape, inside, outside):
    assert shape.contains(P(inside)).all() and not shape.contains(P(outside)).any()


def test_bounds_hold_the_shape():
    random = np.random.default_rng(0).uniform(-4, 4, (20_000, 3))
    for shape in (Cylinder((-1.0, 0.0, 0.5), (1.0, 2.0, 0.0), 0.8), Sphere((0.5, 0.0, 0.0), 2.0)):
        lower, upper = shape.bounds()
        held = random[shape.contains(random)]
        assert len(held) > 100 and np.all(held >= lower - 1e-12) and np.all(held <= upper + 1e-12)
        assert np.all(held.max(axis=0) > upper - 0.4), "the bounds are tight"


def test_everywhere():
    assert Everywhere(2).contains(np.zeros((3, 2))).all() and np.isinf(Everywhere(2).bounds()[0]).all()


@pytest.mark.parametrize("shape", [
    Box((0.0, 0.0), (1.0, 2.0)), Disk((1.0, 1.0), 0.5), Band(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)), 0.4), HalfSpace((1.0, 0.0), (2.0, 1.0)), Sphere((0.0, 0.0, 0.0), 1.0),
    Cylinder((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), 0.7), Cylinder((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), 1.5, 1.0), Box((0.0, 0.0, -1.0), (1.0, 2.0, 1.0)), Everywhere(2),
])
def test_distances_are_to_the_nearest_point_inside(shape):
    """Against the nearest of many points of the shape."""
    dim = len(shape.bounds()[0])
    random = np.random.default_rng(0).uniform(-3, 4, (40_000, dim))
    inside = random[shape.contains(random)]
    points = random[:60]
    nearest = np.linalg.norm(points[:, None] - inside[None], axis=2).min(axis=1)
    distance = shape.distance(points)
    assert np.array_equal(distance == 0, shape.contains(points))
    assert np.all(distance <= nearest + 1e-12) and np.all(nearest[distance > 0] - distance[distance > 0] < (0.1 if dim == 2 else 0.45))


def test_within_and_beyond():
    disk, points = Disk((0.0, 0.0), 1.0), P([[0.5, 0.0], [1.4, 0.0], [1.6, 0.0]])
    assert Within(disk, 0.5).contains(points).tolist() == [True, True, False] and Beyond(disk, 0.5).contains(points).tolist() == [False, False, True]
    assert Beyond(disk, 0.0).contains(points).tolist() == [False, True, True]
    assert Within(disk, 0.5).bounds()[1].tolist() == [1.5, 1.5] and np.isinf(Beyond(disk, 0.5).bounds()[0]).all()


def test_bonded_leaves_out_what_has_no_neighbour_inside():
    """A half plane whose edge lies half a spacing from the lattice: points up to 3 spacings from a row of it are bonded to it, at width 3.5 not those at 4."""
    stencil = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    stencil = stencil[(stencil**2).sum(axis=1) <= 3.5**2]
    half, row = HalfSpace((0.5, 0.0), (-1.0, 0.0)), P([[x, 0.0] for x in (0.0, 1.0, 3.0, 4.0, 5.0)])
    assert Bonded(half, 3.5, 1.0, stencil).contains(row).tolist() == [True, True, True, False, False]
    assert Within(half, 3.5).contains(row).tolist() == [True, True, True, True, False]


def test_distances_from_a_hollow_cylinder():
    """On the axis the wall is a bore's radius away, also past an end: there sideways and along."""
    tube = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), 3.0, 1.0)
    assert tube.distance(P([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0], [2.0, 0.0, 1.0], [5.0, 0.0, 1.0], [0.0, 0.0, 3.0]])) == pytest.approx([1.0, 0.5, 0.0, 2.0, 2**0.5])
