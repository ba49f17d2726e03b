import numpy as np
import pytest

from pdhpc.fem.facets import DIM, FACETS, UNIT_CORNERS, find_neighbours, find_outer_facets, find_stars

MEASURE = {"triangle": 1 / 2, "quad": 1.0, "tetra": 1 / 6, "hexahedron": 1.0}  # of the reference cells


@pytest.mark.parametrize("kind", sorted(FACETS))
def test_facets_point_outward(kind):
    """By Gauss' theorem the sum over facets of (outward normal times area) . centre is dim times the measure of a cell with flat facets."""
    corners, flux, total = UNIT_CORNERS[kind].astype(float), 0.0, np.zeros(DIM[kind])
    for facet in FACETS[kind]:
        p = corners[facet]
        if DIM[kind] == 2:
            normal = np.array([p[1, 1] - p[0, 1], p[0, 0] - p[1, 0]])
        else:
            normal = 0.5 * sum(np.cross(p[k] - p[0], p[k + 1] - p[0]) for k in range(1, len(p) - 1))
        flux += normal @ p.mean(axis=0)
        total += normal
    assert flux == pytest.approx(DIM[kind] * MEASURE[kind], rel=1e-14) and np.allclose(total, 0.0, atol=1e-15)


def test_stars_of_two_triangles():
    start, star = find_stars(np.array([[0, 1, 2], [2, 1, 3]], np.int32), 5)
    assert start.tolist() == [0, 1, 3, 5, 6, 6]
    assert star.tolist() == [0, 0, 1, 0, 1, 1]


def test_outer_facets_of_two_triangles():
    """The edge (1, 2) is shared; of the second triangle, a ghost here, nothing is told."""
    cells = np.array([[0, 1, 2], [2, 1, 3]], np.int32)
    assert [found.tolist() for found in find_outer_facets("triangle", cells, 2, 4)] == [[0, 0, 1, 1], [0, 2, 1, 2]]
    assert find_neighbours("triangle", cells, 2, 4).tolist() == [[-1, 1, -1], [0, -1, -1]]
    assert [found.tolist() for found in find_outer_facets("triangle", cells, 1, 4)] == [[0, 0], [0, 2]]


def test_outer_facets_of_two_hexahedra():
    """Two cubes on top of each other have 10 of 12 faces on the surface: not the first one's top (1), not the second one's bottom (0)."""
    lower = np.arange(8)
    cell, facet = find_outer_facets("hexahedron", np.array([lower, lower + 4], np.int32), 2, 12)
    assert list(zip(cell, facet)) == [(0, f) for f in (0, 2, 3, 4, 5)] + [(1, f) for f in (1, 2, 3, 4, 5)]
