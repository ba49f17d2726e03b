"""Parts made on their own must fit together: every rank's rows, put together, are the rows of the whole body."""
import numpy as np
import pytest

from pdhpc.geometry.lattice import LatticeBody
from pdhpc.geometry.shapes import Box, Disk
from pdhpc.kernels.family import MIXED
from pdhpc.parallel.partition import Partition, bisect
from pdhpc.peridynamics.subdomain import make_subdomain, sample_with_weights

RADIUS = 3.0 * (1 + 1e-9)


class Pretend:
    rank = 0

    def __init__(self, size):
        self.size = size

    def Allreduce(self, in_place, array, op):
        pass


def bodies(dim):
    if dim == 3:
        return [LatticeBody(Box((0.0, 0.0, 0.0), (9.0, 8.0, 7.0)), 1.0, 0)]
    first = LatticeBody(Box((0.0, 0.0), (20.0, 12.0)), 1.0, 0, (Disk((10.0, 6.0), 3.0),))
    return [first, LatticeBody(Box((20.0, 2.0), (30.0, 8.0)), 1.0, first.last_id)]


def describe(points, number, ids):
    return np.ones(len(points)), number.astype(np.uint8)


def rows(subdomain):
    """{id: ids of its neighbours in order} of the owned particles."""
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    found = {}
    for i in range(particles.n_owned):
        slots = arrays.row_start[i] + np.arange(subdomain.bonds.family_size[i])
        found[int(particles.id[i])] = particles.id[arrays.neighbour[slots]].tolist()
    return found


@pytest.mark.parametrize("dim, size", [(2, 2), (2, 3), (2, 7), (3, 4)])
def test_parts_make_up_the_whole(dim, size):
    alone = Partition(np.empty(0, int), np.empty(0), np.empty((0, 2), int), 1)
    whole = rows(make_subdomain(bodies(dim), alone, 0, RADIUS, describe, False))
    samples = [sample_with_weights(bodies(dim), (np.zeros(dim), np.array([30.0, 12.0] if dim == 2 else [9.0, 8.0, 7.0])), rank, size, RADIUS) for rank in range(size)]
    points, weights = np.concatenate([s[0] for s in samples]), np.concatenate([s[1] for s in samples])
    assert len(points) == len(whole) and weights.sum() == sum(map(len, whole.values())), "the sample is the body, weighted by bonds"
    partition = bisect(Pretend(size), points, weights)
    together, work = {}, []
    for rank in range(size):
        part = make_subdomain(bodies(dim), partition, rank, RADIUS, describe, False)
        particles = part.particles
        assert np.all(np.diff(particles.id[: particles.n_owned]) > 0)
        ghosts = particles.id[particles.n_owned :]
        assert np.array_equal(partition.owner(particles.reference[particles.n_owned :]), part.ghost_owner)
        assert np.array_equal(np.lexsort((ghosts, part.ghost_owner)), np.arange(len(ghosts)))
        assert set(ghosts) == {j for row in rows(part).values() for j in row} - set(particles.id[: particles.n_owned]), "exactly the ghosts that are needed"
        assert not set(together) & set(rows(part))
        together.update(rows(part))
        work.append(part.bonds.n_directed)
    assert together == whole
    assert max(work) < 1.35 * np.mean(work)


def test_a_rank_whose_bodies_end_far_from_its_borders_has_no_ghosts():
    """Two boxes 16 apart, cut half way between them: the families of 3 reach across neither border."""
    first = LatticeBody(Box((0.0, 0.0), (4.0, 4.0)), 1.0, 0)
    apart = [first, LatticeBody(Box((20.0, 0.0), (24.0, 4.0)), 1.0, first.last_id)]
    partition = Partition(np.array([0]), np.array([12.0]), np.array([[-1, -2]]), 2)
    for rank in (0, 1):
        part = make_subdomain(apart, partition, rank, RADIUS, describe, False)
        assert part.particles.n_owned == 16 and len(part.ghost_owner) == 0 and part.bonds.family_size.max() == 15, "all others, of those in the middle"


def test_rows_across_a_material_border_are_mixed():
    alone = Partition(np.empty(0, int), np.empty(0), np.empty((0, 2), int), 1)
    part = make_subdomain(bodies(2), alone, 0, RADIUS, describe, False)
    x = part.particles.reference[:, 0]
    row_block = part.points.row_block
    assert np.all(row_block[x < 16] == 0) and np.all(row_block[x > 24] == 1)
    assert row_block[np.argmin(np.hypot(x - 19.5, part.particles.reference[:, 1] - 5.5))] == MIXED
