import itertools

import numpy as np
import pytest

from pdhpc.geometry.cracks import disk, polyline, rectangle
from pdhpc.kernels.bond_states import count_face, count_intact, foremost_damaged
from pdhpc.peridynamics.bonds import cut_by_cracks
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


def lattice(path, cells, radius=2.3):
    """Return the subdomain of a box of cells of side 1 around the origin, families of exactly this radius."""
    dimension = "plane_stress" if len(cells) == 2 else "3d"
    return problem_of(plate(cells, radius, dimension=dimension), ["particles.volume_correction=none", f"particles.path={path}"]).subdomain


@pytest.mark.parametrize("path, dim", list(itertools.product(PATHS, (2, 3))))
def test_counts_follow_the_bits(path, dim, lose_bonds, intact_pairs):
    subdomain = lattice(path, (9, 8) if dim == 2 else (6, 7, 5), 3.0)  # 3D: 122 neighbours, two words of bits
    x, slots = subdomain.places(), subdomain.particles.slots
    near = np.array([(np.linalg.norm(x - at, axis=1) <= 3.0 + 1e-6).sum() - 1 for at in x])
    counts = np.empty(len(x), np.int32)
    count_intact(subdomain.bonds.arrays, slots, counts)
    assert np.array_equal(counts, near) and np.array_equal(subdomain.bonds.family_size, near)
    assert np.array_equal(counts, np.bincount([i for i, _ in intact_pairs(subdomain)]))
    lose_bonds(subdomain, 7)
    count_intact(subdomain.bonds.arrays, slots, counts)
    assert counts[7] == 0 and np.array_equal(np.delete(counts, 7), np.delete(near, 7))
    two = np.empty(2, np.int32)
    count_intact(subdomain.bonds.arrays, slots[[8, 7]], two)
    assert two.tolist() == [near[8], 0]


@pytest.mark.parametrize("path", PATHS)
def test_foremost_of_the_damaged(path, lose_bonds):
    subdomain = lattice(path, (9, 8))
    bonds = subdomain.bonds
    ahead, members = np.random.default_rng(0).random(72), np.arange(72)

    def foremost(threshold, members):
        return foremost_damaged(bonds.arrays, bonds.slots, bonds.initial_size, threshold, members, ahead[members])

    assert foremost(0.1, members) == -1
    for i in (5, 9):
        lose_bonds(subdomain, i)
    best = 5 if ahead[5] > ahead[9] else 9
    assert foremost(0.1, members) == best
    assert foremost(0.1, np.array([3, 14 - best])) == 1
    assert foremost(1.0, members) == -1


@pytest.fixture
def cut_pairs(intact_pairs):
    """Function (subdomain, facets) -> the pairs of ends of the cut bonds."""

    def cut(subdomain, facets):
        before = intact_pairs(subdomain)
        number = cut_by_cracks(subdomain.bonds, subdomain.points, facets)
        pairs = before - intact_pairs(subdomain)
        assert len(pairs) == number
        assert all((j, i) in pairs for i, j in pairs), "cut at both ends"
        assert np.array_equal(subdomain.bonds.initial_size, subdomain.bonds.alive())
        return pairs

    return cut


@pytest.mark.parametrize("path", PATHS)
def test_a_polyline_cuts_what_crosses_it(path, cut_pairs):
    subdomain = lattice(path, (8, 8))
    points, cut = subdomain.places(), cut_pairs(subdomain, polyline([[-4.0, 0.0], [0.0, 0.0]]))
    for i in range(len(points)):
        for j in np.flatnonzero(np.linalg.norm(points - points[i], axis=1) <= 2.3):
            a, b = points[i], points[j]
            crosses = a[1] * b[1] < 0 and a[0] + a[1] / (a[1] - b[1]) * (b[0] - a[0]) <= 1e-9
            assert ((i, j) in cut) == crosses


@pytest.mark.parametrize("path", PATHS)
def test_a_crack_through_a_row_of_particles_separates_the_body(path, cut_pairs):
    subdomain = lattice(path, (9, 9))  # the row y = 0 lies on the crack and belongs to its positive side
    points, cut = subdomain.places(), cut_pairs(subdomain, polyline([[-9.0, 0.0], [9.0, 0.0]]))
    assert cut and all((points[i, 1] >= 0) != (points[j, 1] >= 0) for i, j in cut)
    assert len(cut_pairs(lattice(path, (9, 9)), polyline([[9.0, 0.0], [-9.0, 0.0]]))) == len(cut), "the same number when drawn the other way round"


@pytest.mark.parametrize("path", PATHS)
def test_corners_of_a_polyline_leave_no_gap(path, cut_pairs):
    subdomain = lattice(path, (12, 12))
    points, cut = subdomain.places(), cut_pairs(subdomain, polyline([[-3.0, -6.5], [-3.0, 0.0], [6.5, 0.0]]))
    inside = (points[:, 0] > -3.0) & (points[:, 1] < 0.0)
    for i, j in [(i, j) for i in np.flatnonzero(inside) for j in np.flatnonzero(~inside) if np.linalg.norm(points[i] - points[j]) <= 2.3]:
        assert (i, j) in cut


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("facets, area", [
    (rectangle([-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]), lambda x, y: abs(x) <= 2 and abs(y) <= 2),
    (rectangle([-2.0, 0.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0]), lambda x, y: abs(x) + abs(y) <= 2 + 1e-9),
    (disk([0.0, 0.0, 0.0], [0.0, 0.0, 3.0], 2.2), lambda x, y: x * x + y * y <= 2.2**2),
])
def test_flat_cracks_in_3d(path, facets, area, cut_pairs):
    subdomain = lattice(path, (8, 8, 8), 2.0)
    points, cut = subdomain.places(), cut_pairs(subdomain, facets)
    assert cut
    for i in range(len(points)):
        for j in np.flatnonzero(np.linalg.norm(points - points[i], axis=1) <= 2.0 + 1e-6):
            a, b = points[i], points[j]
            if a[2] * b[2] < 0:
                x, y, _ = a + a[2] / (a[2] - b[2]) * (b - a)
                assert ((i, j) in cut) == area(x, y), (a, b)
            else:
                assert (i, j) not in cut


@pytest.mark.parametrize("path", PATHS)
def test_a_second_crack_along_the_first_cuts_nothing(path, cut_pairs):
    subdomain = lattice(path, (8, 8))
    assert cut_pairs(subdomain, polyline([[-4.0, 0.0], [4.0, 0.0]]))
    assert not cut_pairs(subdomain, polyline([[-3.0, 0.0], [3.0, 0.0]]))


@pytest.mark.parametrize("path", PATHS)
def test_faces_of_a_block_and_of_part_of_it(path):
    subdomain = lattice(path, (6, 4, 3), 2.0)
    particles = subdomain.particles

    def face(selected, axis, step):
        by_slot = np.zeros(len(particles.position), bool)
        by_slot[particles.slots] = selected
        return count_face(subdomain.bonds.arrays, subdomain.points, particles.third, particles.slots, by_slot, axis, step)

    for axis, area in ((0, 12), (1, 18), (2, 24)):
        for step in (1.0, -1.0):
            assert face(np.ones(72, bool), axis, step) == area
    layer = subdomain.places()[:, 1] > 1.0
    assert face(layer, 1, 1.0) == 18
    assert face(layer, 0, 1.0) == 3


@pytest.mark.parametrize("path", PATHS)
def test_a_face_is_that_of_the_uncracked_body(path):
    subdomain = lattice(path, (6, 4))
    particles = subdomain.particles
    cut_by_cracks(subdomain.bonds, subdomain.points, polyline([[0.0, -3.0], [0.0, 3.0]]))
    everything = np.zeros(len(particles.position), bool)
    everything[particles.slots] = True
    assert count_face(subdomain.bonds.arrays, subdomain.points, particles.third, particles.slots, everything, 0, 1.0) == 4
