"""Parts of a lattice made on their own must fit together, and hold the same families as the cloud."""
import itertools

import numpy as np
import pytest

from pdhpc.geometry.lattice import LatticeBody, find_common_lattice
from pdhpc.geometry.shapes import Box, Cylinder, Disk
from pdhpc.kernels.family import MIXED
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting
from pdhpc.parallel.partition import Partition, bisect
from pdhpc.peridynamics.lattice_subdomain import make_lattice_subdomain, make_stencil, sample_lattice
from pdhpc.peridynamics.subdomain import make_subdomain

RATIO = 3.0 * (1 + 1e-9)
ALONE = Partition(np.empty(0, int), np.empty(0), np.empty((0, 2), int), 1)


class Pretend:
    """A communicator of one process that says it has many ranks: the cuts only need sums."""

    rank = 0

    def __init__(self, size):
        self.size = size

    def Allreduce(self, in_place, array, op):
        pass


def bodies(dim, spacing=0.1):
    """Bodies of two materials with a hole that lie on one lattice whose coordinates are no round numbers."""
    if dim == 3:
        first = LatticeBody(Box((0.1, 0.2, 0.3), (1.0, 1.0, 1.0)), spacing, 0, (Cylinder((0.5, 0.5, 0.0), (0.5, 0.5, 2.0), 0.16),))
        return [first, LatticeBody(Box((1.0, 0.4, 0.3), (1.4, 0.9, 1.6)), spacing, first.last_id)]
    first = LatticeBody(Box((0.1, 0.2), (2.1, 1.4)), spacing, 0, (Disk((1.1, 0.8), 0.3),))
    second = LatticeBody(Disk((2.6, 0.9), 0.5), spacing, first.last_id)
    return [first, second, LatticeBody(Box((4.1, 0.0), (4.4, 2.0)), spacing, second.last_id)]


def describe(points, number, ids):
    return np.full(len(points), 0.1 ** points.shape[1]), np.asarray(number).astype(np.uint8)


def law_of(count):
    return BondBased.law([(BondBased(str(n), 1.0 + n, 1.0 + n), True) for n in range(count)], Setting("plane_stress", 0.3, 1.0, "constant", 0.1))


def make(dim, partition=ALONE, rank=0, path="lattice"):
    parts = bodies(dim)
    if path == "cloud":
        return make_subdomain(parts, partition, rank, RATIO * 0.1, describe, False)
    return make_lattice_subdomain(parts, find_common_lattice(parts)[0], partition, rank, RATIO * 0.1, describe, law_of(len(parts)), False)


def rows(subdomain):
    """{id: ids of its neighbours in the order of the bonds} of the owned particles."""
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    if not hasattr(arrays, "offset"):
        near = [arrays.neighbour[arrays.row_start[i] + np.arange(subdomain.bonds.family_size[i])] for i in range(particles.n_owned)]
        return {int(particles.id[i]): particles.id[j].tolist() for i, j in enumerate(near)}
    id_of = np.full(len(particles.position), -1)
    id_of[np.concatenate([particles.slots, particles.ghost_slots])] = particles.id
    found = {}
    for i, slot in enumerate(particles.slots):
        alive = [int(arrays.alive[k >> 6, slot]) >> (k & 63) & 1 for k in range(len(arrays.offset))]
        found[int(particles.id[i])] = id_of[slot + arrays.offset[np.array(alive, bool)]].tolist()
    return found


def partition_of(dim, size):
    parts = bodies(dim)
    common = find_common_lattice(parts)[0]
    samples = [sample_lattice(parts, common, rank, size, RATIO * 0.1) for rank in range(size)]
    points, weights = (np.concatenate([sample[n] for sample in samples]) for n in (0, 1))
    return bisect(Pretend(size), points, weights, common.between), points, weights


@pytest.mark.parametrize("dim, count", [(2, 28), (3, 122)])
def test_a_stencil_is_the_ball_in_the_order_of_ids(dim, count):
    stencil = make_stencil(dim, 3.0 + 1e-9)
    assert len(stencil) == count and np.array_equal(stencil, -stencil[::-1])
    assert np.all((stencil**2).sum(axis=1) <= 9) and np.all(np.diff(stencil @ [100**axis for axis in range(dim)][::-1]) > 0)
    assert len(make_stencil(2, 1.5)) == 8 and len(make_stencil(3, 0.9)) == 0


@pytest.mark.parametrize("dim", (2, 3))
def test_families_are_those_of_the_cloud_in_the_same_order(dim):
    lattice, cloud = make(dim), make(dim, path="cloud")
    assert rows(lattice) == rows(cloud)
    assert np.array_equal(lattice.bonds.family_size, cloud.bonds.family_size) and lattice.bonds.n_directed == cloud.bonds.n_directed
    assert np.allclose(lattice.places(), cloud.places(), atol=1e-14)
    for name in ("block", "volume"):
        assert np.array_equal(lattice.particles.owned(getattr(lattice.particles, name)), cloud.particles.owned(getattr(cloud.particles, name)))


@pytest.mark.parametrize("dim", (2, 3))
def test_places_of_one_body_are_its_centres_to_the_last_bit(dim):
    body = bodies(dim)[0]
    part = make_lattice_subdomain([body], find_common_lattice([body])[0], ALONE, 0, 0.25, describe, law_of(1), False)
    everywhere = np.full(dim, np.inf)
    ids, points = body.points_in(-everywhere, everywhere)
    assert np.array_equal(part.particles.id, ids) and np.array_equal(part.places(), points)
    part.particles.place()
    assert np.array_equal(part.particles.owned(part.particles.position), points), "a body at rest lies where it was made"


@pytest.mark.parametrize("dim, size", [(2, 2), (2, 3), (2, 7), (3, 4)])
def test_parts_make_up_the_whole(dim, size):
    whole = make(dim)
    expected, places = rows(whole), dict(zip(whole.particles.id.tolist(), whole.places().tolist()))
    partition, points, weights = partition_of(dim, size)
    assert len(points) == len(expected) and weights.sum() == sum(map(len, expected.values())), "the sample is the body, weighted by bonds"
    together, work = {}, []
    for rank in range(size):
        part = make(dim, partition, rank)
        particles, mine = part.particles, rows(part)
        owned, ghosts = particles.id[: particles.n_owned], particles.id[particles.n_owned :]
        assert np.all(np.diff(owned) > 0) and not set(together) & set(mine)
        assert np.array_equal(partition.owner(part.places_at(particles.ghost_slots)), part.ghost_owner) and not np.any(part.ghost_owner == rank)
        assert np.array_equal(np.lexsort((ghosts, part.ghost_owner)), np.arange(len(ghosts)))
        assert set(ghosts.tolist()) == {j for row in mine.values() for j in row} - set(owned.tolist()), "exactly the ghosts that are needed"
        assert part.places_at(np.concatenate([particles.slots, particles.ghost_slots])).tolist() == [places[i] for i in particles.id.tolist()]
        together.update(mine)
        work.append(part.bonds.n_directed)
    assert together == expected
    assert max(work) < 1.35 * np.mean(work)


@pytest.mark.parametrize("dim, size", [(2, 3), (3, 4)])
def test_sweeps_go_through_every_particle_once_and_the_interior_sees_no_ghost(dim, size):
    partition, _, _ = partition_of(dim, size)
    for rank in range(size):
        part = make(dim, partition, rank)
        particles, arrays = part.particles, part.bonds.arrays
        interior, border = part.rows
        blocks = np.concatenate([interior, border])
        assert len(set(blocks.tolist())) == len(blocks) and np.all(blocks % 8 == 0)
        assert set((particles.slots // 8 * 8).tolist()) == set(blocks.tolist())
        ghost = np.zeros(len(particles.position), bool)
        ghost[particles.ghost_slots] = True

        def bonds_to_ghosts(block):
            return sum(int(arrays.alive[k >> 6, i]) >> (k & 63) & ghost[i + offset] for i in range(block, block + 8) for k, offset in enumerate(arrays.offset))

        assert not any(bonds_to_ghosts(block) for block in interior) and all(bonds_to_ghosts(block) for block in border)


def test_cells_that_the_rank_does_not_own_have_no_bonds():
    partition, _, _ = partition_of(2, 3)
    for rank in range(3):
        part = make(2, partition, rank)
        others = np.ones(len(part.particles.position), bool)
        others[part.particles.slots] = False
        assert not part.bonds.arrays.alive[:, others].any()
        empty = others.copy()
        empty[part.particles.ghost_slots] = False
        assert np.all(part.particles.block[empty] == MIXED) and np.all(part.particles.block[~empty] < 3)


def test_blocks_across_a_material_border_are_mixed():
    part = make(2)
    particles, x = part.particles, part.places()
    kind = part.bonds.arrays.kind[particles.slots >> 3]
    block = particles.owned(particles.block)
    near = np.array([np.any(block[np.linalg.norm(x - at, axis=1) <= RATIO * 0.1] != b) for at, b in zip(x, block)])
    by_block = {}
    for slot, mixed in zip(particles.slots, near):
        by_block[slot >> 3] = by_block.get(slot >> 3, False) or mixed
    assert np.array_equal(kind == MIXED, [by_block[slot >> 3] for slot in particles.slots])
    assert np.array_equal(kind[kind != MIXED], block[kind != MIXED]) and 0 < np.sum(kind == MIXED) < len(kind)


@pytest.mark.parametrize("dim, size", list(itertools.product((2, 3), (2, 3, 5))))
def test_cuts_lie_between_layers_and_share_the_bonds(dim, size):
    """A box of one material: no rank has more than 3 % above the mean, or one layer of its cells."""
    cells = (60, 41) if dim == 2 else (23, 16, 15)
    body = LatticeBody(Box((0.1,) * dim, tuple(0.1 + 0.1 * n for n in cells)), 0.1, 0)
    common, radius = find_common_lattice([body])[0], RATIO * 0.1
    samples = [sample_lattice([body], common, rank, size, radius) for rank in range(size)]
    partition = bisect(Pretend(size), np.concatenate([s[0] for s in samples]), np.concatenate([s[1] for s in samples]), common.between)
    layers = (partition.cut - 0.1) / 0.1
    assert np.allclose(layers, np.rint(layers), atol=1e-9), "between layers, where no round-off can move a particle"
    parts = [make_lattice_subdomain([body], common, partition, rank, radius, describe, law_of(1), False) for rank in range(size)]
    work = np.array([part.bonds.n_directed for part in parts])
    widest = max(np.prod(np.sort(np.ptp(part.places(), axis=0) / 0.1 + 1)[-(dim - 1) :]) for part in parts)
    assert work.max() - work.mean() <= max(0.03 * work.mean(), widest * (28, 122)[dim - 2])


def test_a_rank_that_owns_nothing():
    tree = Partition(np.array([0]), np.array([100.0]), np.array([[-1, -2]]), 2)  # rank 1 owns x >= 100 m
    part = make(2, tree, 1)
    assert part.particles.n_owned == part.particles.n_ghost == part.bonds.n_directed == 0 and all(len(each) == 0 for each in part.rows)
    assert part.places().shape == (0, 2)
    assert rows(make(2, tree, 0)) == rows(make(2))


def test_coinciding_particles_are_refused():
    body = LatticeBody(Box((0.0, 0.0), (1.0, 1.0)), 0.1, 0)
    other = LatticeBody(Box((0.5, 0.5), (1.5, 1.5)), 0.1, body.last_id)
    with pytest.raises(ValueError, match="same place"):
        make_lattice_subdomain([body, other], find_common_lattice([body, other])[0], ALONE, 0, 0.25, describe, law_of(2), False)
