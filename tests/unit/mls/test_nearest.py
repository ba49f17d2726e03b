"""The nearest particle against brute force, on both storages, with ties, holes and points far away."""
import itertools

import numpy as np
import pytest

from pdhpc.mls.nearest import cells_of_cloud, nearest
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.mls_reference import squares_of

HOLE = '[[body.hole]]\nshape = "{shape}"\ncenter = {center}\nradius = 3.0\n'


def problem_with_a_hole(path, dim):
    cells = (14, 11) if dim == 2 else (11, 8, 9)
    text = plate(cells, 3.0, dimension="plane_stress" if dim == 2 else "3d")
    hole = HOLE.format(shape="disk" if dim == 2 else "sphere", center=[0.0] * dim)
    return problem_of(text.replace("[time]", hole + "[time]"), [f"particles.path={path}"]), np.array(cells)


@pytest.mark.parametrize("path, dim", list(itertools.product(("lattice", "cloud"), (2, 3))))
def test_the_nearest_particle_is_that_of_brute_force(path, dim):
    problem, cells = problem_with_a_hole(path, dim)
    squares, particles = squares_of(problem), problem.subdomain.particles
    points = np.random.default_rng(0).uniform(-cells / 2 - 3, cells / 2 + 3, (2000, dim))
    distance = np.linalg.norm(points[:, None] - problem.subdomain.places(), axis=2)
    expected = particles.slots[distance.argmin(axis=1)]
    limit = 1.75  # half the reach of bonds: horizon 3 and half a spacing of the volume correction
    expected = np.where(distance.min(axis=1) <= limit, expected, -1)
    found = squares.nearest(points)
    assert np.array_equal(found, expected)
    assert 100 < (found < 0).sum() < 1900, "points in the hole and outside belong to nobody"


@pytest.mark.parametrize("path, dim", list(itertools.product(("lattice", "cloud"), (2, 3))))
def test_of_equally_near_particles_the_first_id_counts(path, dim):
    """Corners of cells, moved by no more than rounding errors, lie between 2^dim particles."""
    problem, cells = problem_with_a_hole(path, dim)
    squares, particles = squares_of(problem), problem.subdomain.particles
    corners = np.stack(np.meshgrid(*[np.arange(count + 1) - count / 2 for count in cells], indexing="ij"), axis=-1).reshape(-1, dim)
    points = corners + np.random.default_rng(1).uniform(-1e-12, 1e-12, corners.shape)
    distance = np.linalg.norm(corners[:, None] - problem.subdomain.places(), axis=2)
    near = distance <= distance.min(axis=1)[:, None] + 1e-9
    expected = np.where(distance.min(axis=1) <= 1.75, particles.slots[near.argmax(axis=1)], -1)  # rows of places ascend in id
    assert near.sum(axis=1)[expected >= 0].max() >= 2**dim
    assert np.array_equal(squares.nearest(points), expected)


def test_a_scattered_cloud_and_the_particles_of_others():
    random = np.random.default_rng(2)
    place, ids = random.uniform(0.0, 10.0, (500, 3)) ** 1.5, random.permutation(500)
    reference = np.zeros((500, 4))
    reference[:, :3] = place
    particles = problem_of(plate((3, 3, 3), 2.0, dimension="3d"), ["particles.path=cloud"]).subdomain.points._replace(reference=reference)
    owned = random.random(500) < 0.5
    points = random.uniform(0.0, 30.0, (2000, 3))
    distance = np.linalg.norm(points[:, None] - place, axis=2)
    best = distance.argmin(axis=1)
    expected = np.where((distance.min(axis=1) <= 4.0) & owned[best], best, -1)
    found = nearest(cells_of_cloud(particles, ids, 1.0), owned, points, 4.0)
    assert np.array_equal(found, expected) and (found >= 0).sum() > 100


def test_no_particle_at_all():
    particles = problem_of(plate((3, 3), 2.0), ["particles.path=cloud"]).subdomain.points._replace(reference=np.empty((0, 2)))
    assert nearest(cells_of_cloud(particles, np.empty(0, np.int64), 1.0), np.zeros(0, bool), np.zeros((3, 2)), 1.0).tolist() == [-1, -1, -1]
