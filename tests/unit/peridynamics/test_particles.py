import numpy as np
import pytest

from pdhpc.peridynamics.particles import Particles


@pytest.mark.parametrize("dim, width", [(2, 2), (3, 4)])
@pytest.mark.parametrize("linear", [True, False])
def test_positions_start_at_the_reference(dim, width, linear):
    x = np.random.default_rng(0).random((5, dim))
    particles = Particles(np.arange(5), x, np.ones(5), np.zeros(5, np.uint8), 3, linear)
    assert particles.position.shape == (5, width) and particles.n_ghost == 2 and particles.dim == dim
    assert np.array_equal(particles.position[:, :dim], 0 * x if linear else x)
    assert np.array_equal(particles.reference, x)
    particles.displacement[:] = 0.5
    particles.place()
    assert np.array_equal(particles.position[:3, :dim], (0 if linear else x[:3]) + np.full((3, dim), 0.5))
    assert particles.third is (None if dim == 2 else 2) or particles.third == 2
