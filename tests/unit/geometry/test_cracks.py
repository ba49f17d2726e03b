import numpy as np
import pytest

from pdhpc.geometry.cracks import cut_bonds, disk, polyline, rectangle
from pdhpc.kernels.neighbours import find_bonds


def lattice(dim, n=8):
    axes = np.meshgrid(*[np.arange(n) + 0.5 - n / 2] * dim, indexing="ij")
    return np.stack([axis.ravel() for axis in axes], axis=1)


def cut_pairs(points, facets, radius=2.3):
    """Return the pairs of ends of the cut bonds."""
    bonds, counts = find_bonds(points, np.arange(len(points)), len(points), radius)
    number = cut_bonds(bonds, points, len(points), facets)
    cut = set()
    for i in range(len(points)):
        for k in range(bonds.row_start[i], bonds.row_start[i] + counts[i]):
            if not bonds.alive[k >> 3] >> (k & 7) & 1:
                cut.add((i, int(bonds.neighbour[k])))
    assert len(cut) == number
    assert all((j, i) in cut for i, j in cut), "cut at both ends"
    return cut


def test_a_polyline_cuts_what_crosses_it():
    points = lattice(2)
    cut = cut_pairs(points, polyline([[-4.0, 0.0], [0.0, 0.0]]))
    for i in range(len(points)):
        for j in np.flatnonzero(np.linalg.norm(points - points[i], axis=1) <= 2.3):
            a, b = points[i], points[j]
            crosses = a[1] * b[1] < 0 and a[0] + a[1] / (a[1] - b[1]) * (b[0] - a[0]) <= 1e-9
            assert ((i, j) in cut) == crosses


def test_a_crack_through_a_row_of_particles_separates_the_body():
    points = lattice(2, 9)  # the row y = 0 lies on the crack and belongs to its positive side
    cut = cut_pairs(points, polyline([[-9.0, 0.0], [9.0, 0.0]]))
    assert cut and all((points[i, 1] >= 0) != (points[j, 1] >= 0) for i, j in cut)
    assert len(cut_pairs(points, polyline([[9.0, 0.0], [-9.0, 0.0]]))) == len(cut), "the same number when drawn the other way round"


def test_corners_of_a_polyline_leave_no_gap():
    points = lattice(2, 12)
    cut = cut_pairs(points, polyline([[-3.0, -6.5], [-3.0, 0.0], [6.5, 0.0]]))
    inside = (points[:, 0] > -3.0) & (points[:, 1] < 0.0)
    for i, j in [(i, j) for i in np.flatnonzero(inside) for j in np.flatnonzero(~inside) if np.linalg.norm(points[i] - points[j]) <= 2.3]:
        assert (i, j) in cut


@pytest.mark.parametrize("facets, area", [
    (rectangle([-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]), lambda x, y: abs(x) <= 2 and abs(y) <= 2),
    (rectangle([-2.0, 0.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0]), lambda x, y: abs(x) + abs(y) <= 2 + 1e-9),
    (disk([0.0, 0.0, 0.0], [0.0, 0.0, 3.0], 2.2), lambda x, y: x * x + y * y <= 2.2**2),
])
def test_flat_cracks_in_3d(facets, area):
    points = lattice(3)
    cut = cut_pairs(points, facets, 1.8)
    assert cut
    for i in range(len(points)):
        for j in np.flatnonzero(np.linalg.norm(points - points[i], axis=1) <= 1.8):
            a, b = points[i], points[j]
            if a[2] * b[2] < 0:
                x, y, _ = a + a[2] / (a[2] - b[2]) * (b - a)
                assert ((i, j) in cut) == area(x, y), (a, b)
            else:
                assert (i, j) not in cut
