"""Weighted bonds of marked particles against the same particles unmarked, on both storages."""
import numpy as np
import pytest

from pdhpc.kernels import reference, sweeps
from pdhpc.kernels.shared import share_bonds, weights_of
from pdhpc.warm_up import block

KERNELS = [("lattice", "pmb", 2), ("lattice", "lps", 3), ("cloud", "pmb", 3), ("cloud", "lps", 2)]  # each compiles for ten seconds: not all eight
CHOICES = [(*kernel, linear) for kernel in KERNELS for linear in (False, True)]


def shaken(path, model, dim, linear, strength=np.inf):
    """Return (subdomain, law) of a small cube displaced at random, with p of linear solids up to date; `strength` is the critical stretch from then on."""
    subdomain, law = block(dim, 7 if dim == 2 else 5, 2.0, linear, path, model)
    particles = subdomain.particles
    particles.put(particles.displacement, 1e-3 * np.random.default_rng(2).uniform(-0.02, 0.02, (particles.n_owned, dim)))
    particles.place()
    law.break_at[:] = np.inf
    if model == "lps":
        sweeps.dilatations(*arguments(subdomain, law, subdomain.bonds.arrays, np.concatenate(subdomain.rows)), particles.dissipated)
    law.break_at[:] = strength if linear else (1 + strength) ** 2
    law.critical_stretch[:] = strength
    return subdomain, law


def arguments(subdomain, law, bonds, rows):
    """Return what the sweeps take first."""
    particles = subdomain.particles
    return bonds, subdomain.points, law, subdomain.state, particles.linear, particles.third, rows


def forces_of(subdomain, law, bonds, rows, module=sweeps):
    """Return (forces of all slots, broken) of some rows with these bonds."""
    particles = subdomain.particles
    broken = module.bond_forces(*arguments(subdomain, law, bonds, rows), particles.force_density, particles.dissipated)
    return particles.force_density.copy(), broken


def marked_of(subdomain):
    """Return the slots of every third particle."""
    return np.ascontiguousarray(subdomain.particles.slots[::3])


def shares_of(subdomain, weight=1.0):
    """Return the bonds with this weight at every bond of the marked."""
    bonds = share_bonds(subdomain.bonds.arrays, len(subdomain.points.position), marked_of(subdomain))
    bonds.weight[:] = weight
    return bonds


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
def test_weights_of_one_change_no_bit(path, model, dim, linear):
    """Against the loop bond by bond, which sums weighted bonds too; and against the vector loops to rounding."""
    plain, law = shaken(path, model, dim, linear, 0.02)
    rows = np.concatenate(plain.rows) if path == "lattice" else marked_of(plain)  # the rows of a lattice are blocks of eight
    by_bond, _ = forces_of(plain, law, plain.bonds.arrays, rows, reference)
    weighted, law = shaken(path, model, dim, linear, 0.02)
    marked, alive = marked_of(weighted), weighted.bonds.alive()
    forces, broken = forces_of(weighted, law, shares_of(weighted), marked)
    assert broken == (alive - weighted.bonds.alive()).sum() > 0
    assert np.array_equal(forces[marked], by_bond[marked]) and np.array_equal(weighted.bonds.alive()[::3], plain.bonds.alive()[::3])
    assert np.array_equal(weighted.particles.dissipated[marked], plain.particles.dissipated[marked])
    vectors, law = shaken(path, model, dim, linear, 0.02)
    by_vector, _ = forces_of(vectors, law, vectors.bonds.arrays, np.concatenate(vectors.rows))
    assert np.abs(by_vector[marked] - forces[marked]).max() < 1e-12 * np.abs(by_vector).max()


@pytest.mark.parametrize("path, model, dim, linear", [choice for choice in CHOICES if choice[1] == "lps"])
def test_dilatations_of_weights_of_one_change_no_bit(path, model, dim, linear):
    found = []
    for bonds_of in (lambda subdomain: subdomain.bonds.arrays, shares_of):
        subdomain, law = shaken(path, model, dim, linear)
        particles, marked = subdomain.particles, marked_of(subdomain)
        rows = marked if bonds_of is shares_of or path == "cloud" else np.concatenate(subdomain.rows)
        module = sweeps if bonds_of is shares_of else reference
        subdomain.state[:, 1] = -1.0
        assert module.dilatations(*arguments(subdomain, law, bonds_of(subdomain), rows), particles.dissipated) == 0
        found.append(subdomain.state[marked, 1])
    assert np.array_equal(*found) and np.all(found[0] != -1.0)


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
@pytest.mark.parametrize("share", (0.5, 0.3, 1e-3))
def test_shares_of_a_bond_add_up_to_the_bond(path, model, dim, linear, share):
    """Weights a and 1 - a on either side of an overlap: forces and, for bond-based solids, energies of the two sum to those of the whole."""
    subdomain, law = shaken(path, model, dim, linear)
    marked, parts, energies = marked_of(subdomain), [], []
    for weight in (1.0, share, 1.0 - share):
        bonds, energy = shares_of(subdomain, weight), np.empty(len(subdomain.points.position))
        forces, broken = forces_of(subdomain, law, bonds, marked)
        assert broken == 0
        parts.append(forces[marked])
        sweeps.strain_energy_density(*arguments(subdomain, law, bonds, marked), energy)
        energies.append(energy[marked])
    size = 1e-15 * np.abs(parts[0]).max()
    assert np.abs(parts[1] + parts[2] - parts[0]).max() <= size and np.abs(parts[1] - share * parts[0]).max() <= size
    if model == "pmb":
        assert np.allclose(energies[1] + energies[2], energies[0], rtol=1e-15, atol=0.0)


@pytest.mark.parametrize("path, model, dim", KERNELS)
def test_only_marked_rows_are_swept_and_broken(path, model, dim):
    subdomain, law = shaken(path, model, dim, False, 0.02)
    particles, marked, alive = subdomain.particles, marked_of(subdomain), subdomain.bonds.alive()
    particles.force_density[:] = -1.0
    particles.dissipated[:] = 0.0
    forces, broken = forces_of(subdomain, law, shares_of(subdomain), marked)
    others = np.setdiff1d(np.arange(len(forces)), marked)
    assert np.all(forces[others] == -1.0) and np.all(forces[marked] != -1.0) and np.all(particles.dissipated[others] == 0.0)
    lost = alive - subdomain.bonds.alive()
    assert broken == lost[::3].sum() == lost.sum() > 0


@pytest.mark.parametrize("path, dim", [("lattice", 2), ("cloud", 3)])
def test_weights_are_the_means_of_a_ramp(path, dim, intact_pairs):
    """A pull of weight (ramp_i + ramp_j)/2 at each bond: forces against a sum in numpy."""
    subdomain, law = shaken(path, "pmb", dim, True)
    particles, marked, bonds = subdomain.particles, marked_of(subdomain), shares_of(subdomain)
    ramp, x, u = np.zeros(len(subdomain.points.position)), subdomain.places(), particles.owned(particles.displacement)
    particles.put(ramp, x[:, 0] / x[:, 0].max())
    weights_of(bonds, subdomain.points, ramp, marked)
    forces, _ = forces_of(subdomain, law, bonds, marked)
    of_row, expected = particles.owned(ramp), np.zeros((particles.n_owned, dim))
    for i, j in intact_pairs(subdomain):
        xi = x[j] - x[i]
        weight = 0.5 * (of_row[i] + of_row[j]) * 1e-3**dim / np.linalg.norm(xi) ** 3  # omega = beta = 1, a cell of 1 mm
        expected[i] += law.micromodulus[0, 0] * weight * (xi @ (u[j] - u[i])) * xi
    assert np.abs(forces[marked] - expected[::3]).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("path, model, dim", KERNELS)
def test_the_sweep_without_the_marked_and_that_of_the_marked_are_the_whole(path, model, dim):
    """The seam as methods use it: a rank leaves out rows of its main sweep, particles of a cloud or blocks of a lattice, and sweeps what lies in them apart."""
    subdomain, law = shaken(path, model, dim, False)
    particles, everything = subdomain.particles, np.concatenate(subdomain.rows)
    whole, _ = forces_of(subdomain, law, subdomain.bonds.arrays, everything)
    particles.force_density[:] = 0.0
    chosen = everything[::4]
    marked = chosen if path == "cloud" else np.intersect1d(particles.slots, (chosen[:, None] + np.arange(8)).ravel()).astype(np.int32)
    forces_of(subdomain, law, subdomain.bonds.arrays, np.setdiff1d(everything, chosen).astype(np.int32))
    both, _ = forces_of(subdomain, law, share_bonds(subdomain.bonds.arrays, len(whole), marked), marked)
    assert np.abs(particles.owned(both) - particles.owned(whole)).max() < 1e-12 * np.abs(whole).max()


def test_memory_is_that_of_the_marked():
    subdomain, _ = block(2, 7, 2.0)
    shares = shares_of(subdomain)
    assert len(shares.weight) == 17 * len(subdomain.bonds.arrays.offset) and shares.marked.dtype == np.int32
