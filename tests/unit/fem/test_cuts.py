import math

import numpy as np
import pytest

from pdhpc.fem.cuts import parts
from pdhpc.fem.elements import ELEMENTS
from pdhpc.geometry.shapes import Box, Disk, HalfSpace, Sphere

HATS = (0.0, 1.0)


def moments(kind, corners, shape, kinks=HATS):
    """Return (n, 1 + d): measure and first moments, in reference coordinates, of the part of each element in a shape."""
    element = ELEMENTS[kind]
    rule, found = element.quadrature(3), np.zeros((len(corners), 1 + element.dim))
    for chosen, points, weights in parts(element, np.asarray(corners, float), shape, rule, kinks):
        found[chosen, 0] = weights.sum(axis=1)
        found[chosen, 1:] = (weights[:, :, None] * points).sum(axis=1)
    return found


def cells(kind, *origins):
    """Unit cells at origins."""
    return np.array([ELEMENTS[kind].places + origin for origin in origins])


def test_all_of_space_and_whole_cells():
    corners = cells("quad", [0.0, 0.0], [1.0, 0.0], [2.0, 0.0])
    assert moments("quad", corners, None) == pytest.approx(np.array([[1.0, 0.5, 0.5]] * 3))
    assert moments("quad", corners, Box((0.0, 0.0), (2.0, 1.0))) == pytest.approx(np.array([[1.0, 0.5, 0.5]] * 2 + [[0.0] * 3]))  # a common side is none of it


@pytest.mark.parametrize("kind", ("quad", "hexahedron"))
@pytest.mark.parametrize("kinks", (HATS, (0.0, 0.25, 0.75, 1.0)))
def test_boxes_in_boxes_are_exact(kind, kinks):
    """From 0.41 to 0.44 in x, and the upper 0.7 in the other directions; sides of 2."""
    dim = ELEMENTS[kind].dim
    found, = moments(kind, 2.0 * cells(kind, [0.0] * dim), Box((0.82,) + (0.6,) * (dim - 1), (0.88,) + (9.0,) * (dim - 1)), kinks)
    volume = 0.03 * 0.7 ** (dim - 1)
    assert found == pytest.approx(volume * np.array([1.0, 0.425] + [0.65] * (dim - 1)), rel=1e-13)
    found, = moments(kind, cells(kind, [0.0] * dim), HalfSpace((0.3,) * dim, (0.0,) * (dim - 1) + (-2.0,)), kinks)
    assert found == pytest.approx(0.3 * np.array([1.0] + [0.5] * (dim - 1) + [0.15]), rel=1e-13)


def test_facets_in_boxes_are_exact():
    """A slanting edge from (0, 0) to (2, 1), of which 0.2 <= x and y <= 0.4 leave xi from 0.1 to 0.4; a face across z, seen from both sides of the box's end."""
    assert moments("line", [[[0.0, 0.0], [2.0, 1.0]]], Box((0.2, -1.0), (3.0, 0.4))) == pytest.approx(np.array([[0.3, 0.075]]), rel=1e-13)
    face = np.array([[[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [2.0, 2.0, 1.0], [2.0, 0.0, 1.0]]])  # its first axis along y
    for top, share in ((1.0, 0.2), (0.999, 0.0)):
        found, = moments("quad", face, Box((-1.0, 0.4, 0.0), (1.0, 1.2, top)))
        assert found == pytest.approx(share * np.array([1.0, 0.4, 0.25]), rel=1e-13)


@pytest.mark.parametrize("kind, shape, exact", [
    ("quad", Disk((0.0, 0.0), 0.8), math.pi * 0.16),
    ("hexahedron", Sphere((0.0, 0.0, 0.0), 0.8), math.pi * 0.512 / 6),
    ("hexahedron", HalfSpace((0.4, 0.0, 0.0), (-1.0, -1.0, 0.0)), 0.08),
    ("triangle", Box((0.2, 0.3), (2.0, 2.0)), 0.125),  # what is left is a triangle with legs of 1 - 0.2 - 0.3
    ("tetra", Box((-1.0, -1.0, 0.5), (2.0, 2.0, 2.0)), 0.125 / 6),
    ("quad", Disk((0.3, 0.6), 1e-3), math.pi * 1e-6),  # small within a cell
])
def test_other_parts_are_sampled(kind, shape, exact):
    """To 3 % of the box that the samples lie in, which is at most four thirds as long on each side as what the shape leaves."""
    found, = moments(kind, cells(kind, [0.0] * ELEMENTS[kind].dim), shape)
    lower, upper = (np.clip(each, 0.0, 1.0) for each in shape.bounds())
    assert abs(found[0] - exact) < 0.03 * np.prod(4 / 3 * (upper - lower)) and found[0] > 0.0


def test_a_thin_region_in_a_tilted_cell_is_found():
    """A strip of 0.004 across a square that is turned by 30 degrees."""
    turn = np.array([[math.cos(math.pi / 6), -0.5], [0.5, math.cos(math.pi / 6)]])
    found, = moments("quad", cells("quad", [-0.5, -0.5]) @ turn.T, Box((-0.1, -0.002), (0.1, 0.002)))
    assert found[0] == pytest.approx(0.2 * 0.004, rel=0.1)


def test_a_part_has_the_same_bits_among_others():
    """Whatever stands beside a cell: so on any number of ranks."""
    corners, shape = cells("hexahedron", *np.random.default_rng(1).random((40, 3))), Sphere((1.0, 1.0, 1.0), 0.7)
    together = moments("hexahedron", corners, shape)
    assert all(np.array_equal(moments("hexahedron", corners[k : k + 1], shape)[0], together[k]) for k in range(40)) and np.count_nonzero(together[:, 0]) > 20
