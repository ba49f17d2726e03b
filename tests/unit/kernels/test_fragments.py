"""Sets of particles that intact bonds join, against scipy's connected components."""
import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pdhpc.kernels.fragments import join_intact, lower_labels
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("share", (0.9, 1.2, 1.35))
def test_sets_are_those_of_the_graph(path, share, intact_pairs, lose_bonds):
    """A body of 12 x 9 particles, most of whose bonds are gone at both ends, a tenth of the particles left out."""
    subdomain = problem_of(plate((12, 9)), [f"particles.path={path}"]).subdomain
    particles, random = subdomain.particles, np.random.default_rng(7)
    pairs = {tuple(sorted(pair)) for pair in intact_pairs(subdomain)}
    whole = random.random(108) > 0.1
    lost = np.flatnonzero(random.random(108) < share * 0.7)
    for row in lost:  # at its own end; the other ends still count: bonds join whoever has one
        lose_bonds(subdomain, int(row))
    graph = np.array([pair for pair in intact_pairs(subdomain) if whole[list(pair)].all()]).reshape(-1, 2)
    number = connected_components(coo_matrix((np.ones(len(graph)), graph.T), (108, 108)), directed=False)[1]
    label = np.full(len(particles.position), -1, np.int64)
    name = 1000 + random.permutation(108)
    label[particles.slots[whole]] = name[whole]
    parent, touches = np.full(len(label), -1, np.int32), np.empty(108, bool)
    parent[particles.slots] = particles.slots
    join_intact(subdomain.bonds.arrays, particles.slots, label, parent, touches)
    assert len(pairs) > 500 and not touches.any(), "there are no ghosts"
    assert lower_labels(subdomain.bonds.arrays, particles.slots, particles.slots[:0], label, parent)
    assert not lower_labels(subdomain.bonds.arrays, particles.slots, particles.slots[:0], label, parent)
    found = label[particles.slots]
    assert np.all(found[~whole] == -1)
    lowest = np.full(108, 10**6)
    np.minimum.at(lowest, number[whole], name[whole])
    assert np.array_equal(found[whole], lowest[number[whole]]), "the lowest label of each"
    assert share == 0.9 or len(np.unique(found)) > 5
