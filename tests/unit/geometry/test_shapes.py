import numpy as np
import pytest

from pdhpc.geometry.shapes import Box, Cylinder, Disk, Everywhere, HalfSpace, Sphere

P = np.array


@pytest.mark.parametrize("shape, inside, outside", [
    (Box((0.0, 0.0), (1.0, 2.0)), [[0.5, 1.0], [0.0, 0.0], [1.0, 2.0]], [[1.01, 1.0], [0.5, -0.01]]),
    (Disk((1.0, 1.0), 0.5), [[1.0, 1.0], [1.5, 1.0]], [[1.4, 1.4]]),
    (Sphere((0.0, 0.0, 0.0), 1.0), [[0.5, 0.5, 0.5], [0.0, 0.0, -1.0]], [[0.6, 0.6, 0.6]]),
    (Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), 1.0), [[0.9, 0.0, 2.0], [0.0, 0.0, 0.0]], [[0.8, 0.8, 1.0], [0.0, 0.0, 2.1], [0.0, 0.0, -0.1]]),
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
