import numpy as np
import pytest

from pdhpc.kernels import overlap as loops
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.warm_up import PATHS, NoGhosts, block


@pytest.mark.parametrize("path", PATHS)
def test_marks_spread_along_bonds(path):
    subdomain, _ = block(2, 6, 2.0, False, path)
    particles, places = subdomain.particles, subdomain.places()
    start = 14
    marked, result = np.zeros((len(particles.position), 1)), np.zeros((len(particles.position), 1))
    marked[particles.slots[start]] = 1.0
    loops.spread_marks(subdomain.bonds.arrays, particles.slots, marked, result)
    near = np.linalg.norm(places - places[start], axis=1) < 2.1e-3
    assert np.array_equal(result[particles.slots, 0] > 0, near) and near.sum() == 13


@pytest.mark.parametrize("path", PATHS)
def test_a_bond_broken_elsewhere_is_broken_here_and_its_force_goes(path):
    """All bonds of a particle are reported broken: its force density becomes zero, and what it stored, all bonds at the critical stretch, is what it dissipates."""
    subdomain, law = block(2, 6, 2.0, False, path)
    law.break_at[:] = np.inf
    law.critical_stretch[:] = 1e-3
    particles, i = subdomain.particles, 7
    particles.put(particles.displacement, 1e-3 * subdomain.places())
    particles.place()
    InternalForces(subdomain, law, NoGhosts).evaluate()
    before = strain_energy_density(subdomain, law)[i] * 1e-6
    slots = particles.slots[i : i + 1]
    subdomain.share_rows(slots)
    inside = np.ones(len(particles.position), bool)
    arrays = subdomain.bonds.arrays
    words = np.zeros((3, 1, loops.words_of(arrays, 64)), np.uint64)
    loops.mark_common(arrays, slots, inside, words[0])
    loops.mark_intact(arrays, slots, inside, words[0], words[1])
    count = subdomain.bonds.alive()[i]
    assert sum(bin(int(word)).count("1") for word in words[1].ravel()) == count == 10
    scale = np.abs(particles.force_density[slots]).max()
    broken = loops.break_bits(arrays, subdomain.shared, subdomain.points, law, None, None, None, slots, inside, words[1], words[2], particles.force_density, particles.dissipated)
    assert broken == 10 and subdomain.bonds.alive()[i] == 0
    assert np.abs(particles.force_density[slots]).max() < 1e-12 * scale
    assert particles.dissipated[slots[0]] == pytest.approx(before, rel=1e-9)


def test_largest_elongation():
    subdomain, _ = block(2, 4, 2.0)
    particles = subdomain.particles
    displacement = np.zeros((len(particles.position), 2))
    displacement[particles.slots[5]] = [3.0, 4.0]
    has = np.zeros(len(displacement), bool)
    has[particles.slots] = True
    assert loops.largest_elongation(subdomain.bonds.arrays, particles.slots[:2], displacement, has) == 5.0
    has[particles.slots[5]] = False
    assert loops.largest_elongation(subdomain.bonds.arrays, particles.slots[:2], displacement, has) == 0.0
