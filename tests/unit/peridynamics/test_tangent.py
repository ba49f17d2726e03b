import numpy as np
import pytest

from pdhpc.parallel.comm import Sums
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.tangent import Tangent, unbreakable
from pdhpc.warm_up import MODELS, PATHS, NoGhosts, Variant, block

SPACING = 1e-3


def moved(dim, linear, path, model, comm):
    """Return (Subdomain, law, Tangent) of a strained block, and a smooth field and a rough one."""
    subdomain, law = block(dim, 8, 2.0, linear, path, model)
    particles, x = subdomain.particles, subdomain.places() / SPACING
    particles.put(particles.displacement, SPACING * 0.02 * np.sin(0.4 * x + 0.3 * x[:, ::-1]))
    particles.place()
    whole = unbreakable(subdomain, law)
    InternalForces(*whole, NoGhosts).evaluate()
    return *whole, Tangent(*whole, NoGhosts, Sums(comm), SPACING), [np.sin(0.2 * x[:, ::-1]), np.random.default_rng(3).standard_normal(x.shape)]


def exact_change(subdomain, law, w, pairs):
    """Return J w by a sum over pairs, finite kinematics: f_ij = t(e) y/|y| V_j with t of pmb or lps, differentiated by hand."""
    particles = subdomain.particles
    x, y = subdomain.places(), subdomain.places() + particles.owned(particles.displacement)
    volume = particles.owned(particles.volume)
    i, j = np.array(sorted(pairs)).T
    xi, bond, dw = x[j] - x[i], y[j] - y[i], w[j] - w[i]
    r, length = np.linalg.norm(xi, axis=1), np.linalg.norm(bond, axis=1)
    unit = bond / length[:, None]
    extension, rate, n = length - r, np.einsum("nd,nd->n", unit, dw), len(x)
    if hasattr(law, "micromodulus"):
        t, dt = (law.micromodulus[0, 0] * each / r for each in (extension, rate))
    else:
        dim = x.shape[1]
        m = np.bincount(i, r * r * volume[j], n)
        k = (law.volumetric[0] * law.deviatoric[0] ** 2 / dim + (dim + 2) * law.deviatoric[0] / (dim * (dim + 2))) / dim  # d k - (d + 2) G = volumetric dev^2/d
        g = law.deviatoric[0] / (dim * (dim + 2))
        parts = []
        for each in (extension, rate):
            theta = dim / m * np.bincount(i, r * each * volume[j], n)
            state = [((dim * k - (dim + 2) * g) * theta[end] * r + dim * (dim + 2) * g * each) / m[end] for end in (i, j)]
            parts.append(state[0] + state[1])
        t, dt = parts
    turned = (dw - rate[:, None] * unit) / length[:, None]
    change = (dt[:, None] * unit + t[:, None] * turned) * volume[j][:, None]
    return np.stack([np.bincount(i, change[:, axis], n) for axis in range(x.shape[1])], axis=1)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("dim", (2, 3))
def test_finite_kinematics_agree_with_the_exact_derivative(path, model, dim, comm, intact_pairs):
    subdomain, law, tangent, fields = moved(dim, False, path, model, comm)
    before = subdomain.particles.owned(subdomain.particles.force_density).copy()
    for w in fields:
        tangent.apply(w, dict.fromkeys(("force", "exchange", "wait"), 0.0))
        expected = exact_change(subdomain, law, w, intact_pairs(subdomain))
        assert np.abs(tangent.change - expected).max() < 1e-6 * np.abs(expected).max()
    assert np.array_equal(before, subdomain.particles.owned(subdomain.particles.force_density)), "the body's own fields stay"


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
def test_linear_kinematics_take_the_forces_of_the_field(path, model, comm):
    subdomain, law, tangent, (w, _) = moved(2, True, path, model, comm)
    tangent.apply(w, dict.fromkeys(("force", "exchange", "wait"), 0.0))
    particles = subdomain.particles
    particles.put(particles.displacement, w)
    particles.place()
    InternalForces(subdomain, law, NoGhosts).evaluate()
    assert np.array_equal(tangent.change, particles.owned(particles.force_density))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("linear", (True, False))
def test_no_bond_of_the_unbreakable_body_breaks(path, model, linear):
    subdomain, law = block(2, 6, 2.0, linear, path, model)
    particles = subdomain.particles
    particles.put(particles.displacement, subdomain.places() * [10 * law.critical_stretch[0, 0], 0.0])
    particles.place()
    other, unbroken = unbreakable(subdomain, law)
    before = subdomain.bonds.alive()
    assert InternalForces(other, unbroken, NoGhosts).evaluate() == 0 and np.array_equal(subdomain.bonds.alive(), before)
    assert InternalForces(subdomain, law, NoGhosts).evaluate() > 0 and np.array_equal(other.bonds.alive(), subdomain.bonds.alive()), "both hold the same bonds"


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("variant", [Variant(), Variant(failure="energy"), Variant(softening=0.25), Variant(horizons=True, correction="energy")])
def test_nothing_breaks_an_unbreakable_body(model, variant):
    """Stretched to thrice its length, by a law of any kind."""
    if model == "lps" and (variant.correction != "none"):
        variant = variant._replace(correction="none")
    subdomain, law = block(2, 6, 2.0, False, "cloud", model, variant)
    particles = subdomain.particles
    particles.put(particles.displacement, 2.0 * subdomain.places())
    particles.place()
    assert InternalForces(*unbreakable(subdomain, law), NoGhosts).evaluate() == 0
    assert InternalForces(subdomain, law, NoGhosts).evaluate() == subdomain.bonds.n_directed
