import numpy as np
import pytest

from pdhpc.geometry.lattice import LatticeBody
from pdhpc.geometry.shapes import Box
from pdhpc.parallel.partition import Partition
from pdhpc.peridynamics.crowding import find_close, find_crowded
from pdhpc.peridynamics.subdomain import make_subdomain

WHOLE = Partition(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), 1)
RADIUS = 3.0 * (1 + 1e-9)


def lattices(shift, radius):
    """Return (subdomain, body of each particle) of two lattices of spacing 1, 8 x 8, the second one moved by `shift`."""
    first = LatticeBody(Box((0.0, 0.0), (8.0, 8.0)), 1.0, 0)
    second = LatticeBody(Box(tuple(shift), tuple(8.0 + x for x in shift)), 1.0, 64)

    def describe(points, number, ids):
        return np.ones(len(points)), np.zeros(len(points), np.uint8)

    subdomain = make_subdomain([first, second], WHOLE, 0, radius, describe, False)
    return subdomain, (subdomain.particles.id >= 64).astype(int)


def crowded(shift, wide=RADIUS):
    """Look at two lattices of spacing 1, 8 x 8, the second one moved by `shift`, with families of radius `wide`."""
    radius = np.array([[RADIUS, 0.5 * (RADIUS + wide)], [0.5 * (RADIUS + wide), wide]])
    subdomain, body = lattices(shift, radius)
    found = find_crowded(subdomain, np.ones(len(body)), body, np.pi * radius**2)
    assert found is None or body[found[0]] != body[found[1]] or found[2] == 0
    return found


@pytest.mark.parametrize("shift, near", [
    ((8.0, 0.0), False), ((8.0, 0.5), False), ((7.76, 0.0), False),  # touching, sliding, columns 0.76 apart
    ((7.74, 0.0), True), ((5.5, 0.5), True), ((6.4, 0.3), True), ((0.4, 0.4), True),
])
def test_suspiciously_near_particles_are_counted(shift, near):
    """As all pairs say; spacing, size and the distance of the nearest one of the own body are 1."""
    subdomain, body = lattices(shift, np.full((2, 2), RADIUS))
    count, facing, i, j = find_close(subdomain, np.ones(len(body)), body)
    first, second = (subdomain.particles.reference[body == each] for each in (0, 1))
    gaps = np.linalg.norm(first[:, None] - second[None], axis=2)
    assert count == (gaps.min(axis=1) < 0.75).sum() + (gaps.min(axis=0) < 0.75).sum()
    assert facing == (gaps.min(axis=1) < 1.5).sum() + (gaps.min(axis=0) < 1.5).sum()
    assert (count > 0) == near and (count == 0 or body[i] != body[j])


def test_flat_cells_that_face_each_other_are_not_near():
    """Cells of 1 x 4 side by side: as near as those of their own, at half of their size."""
    subdomain, body = lattices((8.0, 0.0), np.full((2, 2), RADIUS))
    assert find_close(subdomain, np.full(len(body), 2.0), body)[0] == 0


def test_coarse_beside_fine_is_not_near():
    """They face each other: the 8 coarse ones, 32 fine ones of the first column, 16 of the second, 0.875 away. Cells of 1 and 0.25 that touch are 0.625 apart, less than 0.75 of the coarse ones' distance, not less than 0.75 of the mean size."""
    coarse, fine = LatticeBody(Box((0.0, 0.0), (8.0, 8.0)), 1.0, 0), LatticeBody(Box((8.0, 0.0), (10.0, 8.0)), 0.25, 64)
    subdomain = make_subdomain([coarse, fine], WHOLE, 0, np.full((2, 2), RADIUS), lambda x, number, ids: (np.ones(len(x)), np.zeros(len(x), np.uint8)), False)
    body = (subdomain.particles.id >= 64).astype(int)
    assert find_close(subdomain, np.where(body == 0, 1.0, 0.25), body) == (0, 8 + 32 + 16, -1, -1)
    assert find_close(subdomain, np.ones(len(body)), body)[0] > 0, "of sizes that are not theirs it is"


def test_bodies_that_touch_are_fine():
    assert crowded((8.0, 0.0)) is None and crowded((8.0, 0.5)) is None and crowded((7.3, 0.0)) is None


def test_particles_too_close():
    i, j, fullness = crowded((7.2, 0.0))
    assert fullness == 0.0 and {i < 64, j < 64} == {True, False}
    assert crowded((0.1, 0.1))[2] == 0.0


def test_families_too_full():
    """Half a cell apart no two particles are closer than 0.7 spacings, but each ball of 28.3 m^2 holds some of each body: 2 x 28 or 29 in the middle."""
    fullness = crowded((0.5, 0.5))[2]
    assert 1.5 < fullness < 2.1
    assert crowded((4.5, 0.5))[2] > 1.5


def test_families_of_two_horizons_fill_their_own_balls():
    """Of 1 of each body's own, at twice the horizon too: 2 where both lie in one place, 1 where they touch."""
    assert crowded((8.0, 0.0), 2 * RADIUS) is None and crowded((8.0, 0.5), 2 * RADIUS) is None
    assert 1.5 < crowded((0.5, 0.5), 2 * RADIUS)[2] < 2.2


def test_a_point_given_nearly_twice():
    """Particles of one body may lie closer, but not at a hundredth of their size."""
    from pdhpc.geometry.points import PointBody

    for gap, expected in ((0.02, None), (0.009, (0, 1, 0.0))):
        points = np.array([[0.0, 0.0], [gap, 0.0], [1.0, 0.0]])
        body = PointBody(0, 3, 3, np.arange(3), points, np.ones(3), np.zeros(3, np.uint64), points[0], points[2], (1.0, 1.0, 1.0))
        subdomain = make_subdomain([body], WHOLE, 0, RADIUS, lambda points, number, ids: (np.ones(len(points)), np.zeros(len(points), np.uint8)), False)
        assert find_crowded(subdomain, np.ones(3), np.zeros(3, int), np.full((1, 1), np.pi * RADIUS**2)) == expected


def test_coincident_particles_are_named():
    with pytest.raises(ValueError, match="same place") as caught:
        crowded((0.0, 0.0))
    assert caught.value.ids == (0, 64)


def test_a_full_family_of_one_body_is_its_own_affair():
    """Volumes are what a file says; only strangers in a family show that bodies overlap."""
    body = LatticeBody(Box((0.0, 0.0), (8.0, 8.0)), 1.0, 0)
    subdomain = make_subdomain([body], WHOLE, 0, RADIUS, lambda points, number, ids: (np.full(len(points), 3.0), np.zeros(len(points), np.uint8)), False)
    assert find_crowded(subdomain, np.full(64, 3**0.5), np.zeros(64, int), np.full((1, 1), np.pi * RADIUS**2)) is None
