"""Blocks of eight particles: bits of their bonds, lanes without a particle, and materials that meet. test_sweeps.py sums the forces in numpy."""
import itertools

import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.kernels import sweeps
from pdhpc.kernels.lattice import WORD, count_bits
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import MODELS


@kernel
def _count(words, counts):
    for n in range(len(words)):
        counts[n] = count_bits(words[n])


def test_count_bits():
    words = np.concatenate([np.array([0, 1, 255, 2**63, 2**64 - 1], np.uint64), np.random.default_rng(0).integers(0, 2**64, 200, dtype=np.uint64)])
    counts = np.empty(len(words), np.int64)
    _count(words, counts)
    assert counts.tolist() == [bin(int(word)).count("1") for word in words]


LPS = ["material.solid.model=lps", "material.solid.poissons_ratio=0.1"]


def evaluated(cells, model="pmb", hole="", extra="", ratio=3.0, path="lattice", seed=1):
    """Return (subdomain, law) of a body displaced at random by place, forces computed."""
    dim = len(cells)
    text = plate(cells, ratio, kinematics="finite", dimension="3d" if dim == 3 else "plane_stress", extra=extra).replace("[time]", hole + "[time]")
    problem = problem_of(text, [f"particles.path={path}", *(LPS if model == "lps" else [])])
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, 0.01 * np.sin(seed + x @ np.random.default_rng(seed).uniform(-2, 2, (dim, dim))))
    problem.stepper()
    return problem.subdomain, problem.body.law


@pytest.mark.parametrize("model, cells", list(itertools.product(MODELS, ((9, 1), (3, 4), (13, 2, 3)))))
def test_words_of_all_lengths_and_lanes_without_particles(model, cells):
    """Bodies narrower than a block, and families of 36 bonds in one word and of 178 in three: as the cloud."""
    found = []
    for path in ("lattice", "cloud"):
        subdomain, _ = evaluated(cells, model, path=path)
        particles = subdomain.particles
        found.append(particles.owned(particles.force_density).copy())
        if path == "lattice":
            arrays = subdomain.bonds.arrays
            assert len(arrays.alive) == -(-len(arrays.offset) // WORD) and len(arrays.offset) == (36 if len(cells) == 2 else 178)
    assert np.abs(found[0] - found[1]).max() <= 1e-12 * np.abs(found[1]).max()


HOLE = '[[body.hole]]\nshape = "disk"\ncenter = [1.5, 0.5]\nradius = 3.1\n'


@pytest.mark.parametrize("model", MODELS)
def test_cells_without_a_particle_feel_and_do_nothing(model):
    subdomain, law = evaluated((21, 13), model, HOLE)
    particles = subdomain.particles
    empty = np.ones(len(particles.position), bool)
    empty[particles.slots] = False
    assert np.all(particles.force_density[empty] == 0.0) and np.all(particles.dissipated[empty] == 0.0)
    force = particles.owned(particles.force_density).copy()
    particles.position[empty] = 1e6  # whatever lies there
    if subdomain.state is not None:
        subdomain.state[empty] = 1e6
    rows = np.concatenate(subdomain.rows)
    arguments = subdomain.bonds.arrays, subdomain.points, law, subdomain.state, None, None, rows
    if subdomain.state is not None:
        sweeps.dilatations(*arguments, particles.dissipated)
    assert sweeps.bond_forces(*arguments, particles.force_density, particles.dissipated) == 0
    assert np.array_equal(particles.owned(particles.force_density), force)


@pytest.mark.parametrize("model, cells", list(itertools.product(MODELS, ((21, 9), (9, 21), (5, 6, 11), (11, 5, 6)))))
def test_axes_of_the_grid_do_not_change_the_order_of_sums(model, cells):
    """A body cut along another axis is another grid with another fastest axis: a particle far from the cut keeps its bits."""
    whole, _ = evaluated(cells, model, ratio=2.0)
    long = int(np.argmax(cells))
    half = list(cells)
    half[long] = cells[long] // 2 + 1
    upper = [count / 2 for count in cells]
    lower = [-each for each in upper]
    text = plate(cells, 2.0, kinematics="finite", dimension="3d" if len(cells) == 3 else "plane_stress")
    cut = [*upper]
    cut[long] = lower[long] + half[long]
    short = problem_of(text.replace(f"upper = {upper}", f"upper = {cut}"), ["particles.path=lattice", *(LPS if model == "lps" else [])])
    particles, x = short.subdomain.particles, short.subdomain.places()
    dim = len(cells)
    particles.put(particles.displacement, 0.01 * np.sin(1 + x @ np.random.default_rng(1).uniform(-2, 2, (dim, dim))))
    short.stepper()
    row_of = {tuple(place): row for row, place in enumerate(whole.places().tolist())}
    far = x[:, long] < cut[long] - (4 if model == "lps" else 2) - 0.1
    rows = [row_of[tuple(place)] for place in x[far].tolist()]
    assert far.sum() >= 9
    assert np.array_equal(particles.owned(particles.force_density)[far], whole.particles.owned(whole.particles.force_density)[rows])
    assert np.array_equal(short.subdomain.bonds.alive()[far], whole.bonds.alive()[rows])
