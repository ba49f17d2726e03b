import numpy as np
import pytest

from pdhpc.kernels import tangent
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.tangent import stiffness_blocks, unbreakable
from pdhpc.warm_up import MODELS, PATHS, NoGhosts, Variant, block

SPACING = 1e-3


VARIANTS = [("lattice", Variant()), ("cloud", Variant()), ("lattice", Variant(influence="conical")), ("cloud", Variant(horizons=True)), ("cloud", Variant(correction="energy")),
            ("cloud", Variant(correction="volume", failure="energy")), ("cloud", Variant(softening=0.25))]


@pytest.mark.parametrize("path, variant", VARIANTS)
@pytest.mark.parametrize("dim, linear", [(2, True), (2, False), (3, True), (3, False)])
def test_blocks_of_bonds_are_the_derivative_of_a_particle_s_own_force(path, variant, dim, linear):
    """Moving one particle alone, f_i = - A_i u_i of a bond-based body at rest."""
    subdomain, law = unbreakable(*block(dim, 5, 2.0, linear, path, "pmb", variant))
    particles = subdomain.particles
    particles.place()
    blocks = stiffness_blocks(subdomain, law)
    row, small = particles.n_owned // 3, 1e-6 * SPACING
    forces = InternalForces(subdomain, law, NoGhosts)
    for axis in range(dim):
        pair = []
        for sign in (1.0, -1.0):
            particles.displacement[...] = 0.0
            particles.displacement[particles.slots[row], axis] = sign * small
            particles.place()
            forces.evaluate()
            pair.append(particles.owned(particles.force_density)[row].copy())
        assert (pair[0] - pair[1]) / (2 * small) == pytest.approx(-blocks[row][axis], rel=1e-5, abs=1e-6 * np.abs(blocks).max())


@pytest.mark.parametrize("model", MODELS)
def test_bounded_blocks_are_what_critical_steps_come_from(model):
    """|A|/rho of the stiffest particle is the square of the frequency that critical_step.py takes."""
    from pdhpc.peridynamics.critical_step import stable_step

    subdomain, law = block(2, 6, 2.0, True, "lattice", model)
    rows = np.abs(stiffness_blocks(subdomain, law, True)).sum(axis=2).max()
    assert np.sqrt(2.0 * law.density[0] / rows) == pytest.approx(stable_step(subdomain, law), rel=1e-12)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("linear", (True, False))
def test_the_largest_stretch_of_an_even_one(path, linear):
    subdomain, law = block(2, 6, 2.0, linear, path, "pmb")
    particles, limit = subdomain.particles, law.critical_stretch[0, 0]
    particles.put(particles.displacement, subdomain.places() * [0.5 * limit, 0.0])
    particles.place()
    arguments = law, particles.linear, particles.third, particles.slots
    assert tangent.largest_stretch(subdomain.bonds.arrays, subdomain.points, *arguments) == pytest.approx(0.5, rel=1e-9)
    unbreakable = law._replace(critical_stretch=np.full_like(law.critical_stretch, np.inf))
    assert tangent.largest_stretch(subdomain.bonds.arrays, subdomain.points, unbreakable, *arguments[1:]) == 0.0
