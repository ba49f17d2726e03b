"""Moving least squares on several ranks: every point is one rank's, and has the bits it has on one rank."""
import itertools

import numpy as np
import pytest
from mpi4py import MPI

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.mls_reference import squares_of

CASES = list(itertools.product(("lattice", "cloud"), (2, 3), (1, 2)))
CRACK = {
    2: '[[crack]]\ntype = "polyline"\npoints = [[-100.0, -3.2], [1.3, 0.4]]\n',
    3: '[[crack]]\ntype = "rectangle"\ncorner = [-100.0, -20.0, -100.0]\nedge1 = [101.0, 20.3, 0.0]\nedge2 = [0.0, 0.0, 200.0]\n',
}
CELLS = {2: (30, 21), 3: (14, 9, 10)}
_NEVER = 1e300  # where no value must be read


def problem_on(comm, path, dim, cells=None):
    text = plate(cells or CELLS[dim], 3.0, extra="" if cells else CRACK[dim], dimension="3d" if dim == 3 else "plane_stress")
    return build(parse_scene(text, "t", [f"particles.path={path}", "time.dt=0.01"]), comm)


def scattered_and_corners(cells):
    """Points anywhere, outside too, and the corners of cells, equally near to 2^dim particles, often of several ranks."""
    cells = np.array(cells)
    anywhere = np.random.default_rng(0).uniform(-cells / 2 - 1.5, cells / 2 + 1.5, (3000, len(cells)))
    corners = np.stack(np.meshgrid(*[np.arange(count + 1) - count / 2 for count in cells], indexing="ij"), axis=-1).reshape(-1, len(cells))
    return np.concatenate([anywhere, corners])


def reconstructed(problem, degree, points):
    """Return the Reconstruction of a rough field known to the owners only, ghosts refreshed."""
    particles, subdomain = problem.subdomain.particles, problem.subdomain
    x = subdomain.places()
    values = np.full((len(subdomain.points.position), 2), _NEVER)
    particles.put(values, np.sin(np.stack([1.3 * x[:, 0] * x[:, 1], x[:, -1] + 0.7 * x[:, 0]], axis=1)))
    problem.exchange.bind(values).refresh()
    squares = squares_of(problem, degree)
    return squares.reconstruct(points, squares.nearest(points), values)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, dim, degree", CASES)
def test_every_point_has_one_rank_and_the_bits_of_one_rank(comm, path, dim, degree):
    points = scattered_and_corners(CELLS[dim])
    alone = reconstructed(problem_on(MPI.COMM_SELF, path, dim), degree, points)
    mine = reconstructed(problem_on(comm, path, dim), degree, points)
    here = mine.degree >= 0
    assert np.array_equal(comm.allreduce(here.astype(int)), (alone.degree >= 0).astype(int))
    assert 0 < here.sum() < (alone.degree >= 0).sum() < len(points)
    assert np.array_equal(mine.degree[here], alone.degree[here])
    assert np.array_equal(mine.value[here], alone.value[here]) and np.array_equal(mine.gradient[here], alone.gradient[here])
    assert np.array_equal(comm.allreduce(mine.value), alone.value) and np.array_equal(comm.allreduce(mine.gradient), alone.gradient)
    assert np.abs(alone.value).max() < 1e3, "nothing was read that nobody wrote"


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", ("lattice", "cloud"))
def test_a_rank_that_owns_nothing_has_no_point(comm, path):
    problem = problem_on(comm, path, 2, (1, 1))
    found = reconstructed(problem, 1, np.zeros((1, 2)))
    assert comm.allreduce(int(found.degree[0] >= 0)) == 1
    assert (found.degree[0] == 0) == (problem.subdomain.particles.n_owned == 1)
