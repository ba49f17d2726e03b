"""Shared bonds of marked particles against the same particles unmarked, and against the loop bond by bond, on both storages."""
import numpy as np
import pytest

from pdhpc.jit import sweep
from pdhpc.kernels import reference, sweeps
from pdhpc.kernels.shared import set_over_energies, set_over_masses, share_bonds, share_by_ramp, stiffnesses
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
    """Return every third row: particles of a cloud, blocks of a lattice."""
    return np.ascontiguousarray(np.sort(np.concatenate(subdomain.rows))[::3])


def particles_of(subdomain, rows):
    """Return the slots of the particles in some rows."""
    slots = subdomain.particles.slots
    return slots[np.isin(slots, rows)] if subdomain.particles.contiguous else slots[np.isin(slots // 8 * 8, rows)]


def shares_of(subdomain):
    """Return the bonds with shares of 1 for the marked rows."""
    return share_bonds(subdomain.bonds.arrays, len(subdomain.points.position), marked_of(subdomain))


def shared_at_random(subdomain):
    """Return the bonds of the marked rows with symmetric random weights, over_mass and over_energy."""
    bonds, slots = shares_of(subdomain), particles_of(subdomain, marked_of(subdomain))
    ramp = np.zeros(len(subdomain.points.position))
    ramp[:] = np.random.default_rng(4).uniform(0.1, 0.9, len(ramp))
    share_by_ramp(bonds, ramp, slots)
    set_over_masses(bonds, slots, 1.0 / ramp[slots])
    set_over_energies(bonds, slots, 2.0 - ramp[slots])
    return bonds, ramp


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
def test_shares_of_one_change_no_bit(path, model, dim, linear):
    plain, law = shaken(path, model, dim, linear, 0.02)
    marked = marked_of(plain)
    slots = particles_of(plain, marked)
    expected, broken = forces_of(plain, law, plain.bonds.arrays, marked)
    weighted, law = shaken(path, model, dim, linear, 0.02)
    forces, found = forces_of(weighted, law, shares_of(weighted), marked)
    assert found == broken > 0
    assert np.array_equal(forces[slots], expected[slots]) and np.array_equal(weighted.bonds.alive(), plain.bonds.alive())
    assert np.array_equal(weighted.particles.dissipated, plain.particles.dissipated)


@pytest.mark.parametrize("path, model, dim, linear", [choice for choice in CHOICES if choice[1] == "lps"])
def test_dilatations_of_shares_of_one_change_no_bit(path, model, dim, linear):
    found = []
    for bonds_of in (lambda subdomain: subdomain.bonds.arrays, shares_of):
        subdomain, law = shaken(path, model, dim, linear)
        marked = marked_of(subdomain)
        subdomain.state[:, 1] = -1.0
        assert sweeps.dilatations(*arguments(subdomain, law, bonds_of(subdomain), marked), subdomain.particles.dissipated) == 0
        found.append(subdomain.state[particles_of(subdomain, marked), 1])
    assert np.array_equal(*found) and np.all(found[0] != -1.0)


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
def test_vectors_of_shared_bonds_agree_with_the_loop_bond_by_bond(path, model, dim, linear):
    """Forces, p, energies, frequencies and broken bonds of random shares."""
    results = []
    for module in (sweeps, reference):
        subdomain, law = shaken(path, model, dim, linear, 0.02)
        bonds, ramp = shared_at_random(subdomain)
        marked, energy = marked_of(subdomain), np.zeros(len(ramp))
        slots, dissipated = particles_of(subdomain, marked), subdomain.particles.dissipated
        broken = module.dilatations(*arguments(subdomain, law, bonds, marked), dissipated) if model == "lps" else 0
        forces, more = forces_of(subdomain, law, bonds, marked, module)
        if module is sweeps:
            sweeps.strain_energy_density(*arguments(subdomain, law, bonds, marked), energy)
        else:
            energies_by_bond(*arguments(subdomain, law, bonds, slots), energy)
        third = subdomain.particles.third
        frequency = (sweeps.largest_frequency2 if module is sweeps else frequency_by_bond)(
            bonds, subdomain.points, law, subdomain.state, third, marked if module is sweeps else slots)
        state = np.zeros(1) if subdomain.state is None else subdomain.state[slots, 1]
        results.append((forces[slots], state, energy[slots], np.array([frequency]), dissipated[slots], broken + more))
    assert results[0][-1] == results[1][-1] > 0
    for found, expected in zip(results[0][:-1], results[1][:-1]):
        assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@sweep
def energies_by_bond(bonds, points, law, state, linear, third, slots, energy):
    for n in range(len(slots)):
        reference.energy_of(bonds, slots[n], points, law, state, linear, third, energy)


@sweep
def frequency_by_bond(bonds, points, law, state, third, slots):
    largest = 0.0
    for n in range(len(slots)):
        largest = max(largest, reference.frequency_of(bonds, slots[n], points, law, state, third))
    return largest


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
@pytest.mark.parametrize("share", (0.5, 0.3, 1e-3))
def test_shares_of_a_bond_add_up_to_the_bond(path, model, dim, linear, share):
    """Weights a and 1 - a on either side of an overlap: forces and, for bond-based solids, energies of the two sum to those of the whole."""
    subdomain, law = shaken(path, model, dim, linear)
    marked, parts, energies = marked_of(subdomain), [], []
    slots = particles_of(subdomain, marked)
    for weight in (1.0, share, 1.0 - share):
        bonds, energy = shares_of(subdomain), np.empty(len(subdomain.points.position))
        bonds.weight[:] = weight
        forces, broken = forces_of(subdomain, law, bonds, marked)
        assert broken == 0
        parts.append(forces[slots])
        sweeps.strain_energy_density(*arguments(subdomain, law, bonds, marked), energy)
        energies.append(energy[slots])
    size = 1e-14 * np.abs(parts[0]).max()  # each force is a sum of up to 122 rounded terms
    assert np.abs(parts[1] + parts[2] - parts[0]).max() <= size and np.abs(parts[1] - share * parts[0]).max() <= size
    if model == "pmb":
        assert np.allclose(energies[1] + energies[2], energies[0], rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("path, model, dim", KERNELS)
def test_only_marked_rows_are_swept_and_broken(path, model, dim):
    subdomain, law = shaken(path, model, dim, False, 0.02)
    particles, marked, alive = subdomain.particles, marked_of(subdomain), subdomain.bonds.alive()
    particles.force_density[:] = -1.0
    particles.dissipated[:] = 0.0
    forces, broken = forces_of(subdomain, law, shares_of(subdomain), marked)
    slots = particles_of(subdomain, marked)
    others = np.setdiff1d(particles.slots, slots)
    assert np.all(forces[others] == -1.0) and np.all(forces[slots] != -1.0) and np.all(particles.dissipated[others] == 0.0)
    lost = alive - subdomain.bonds.alive()
    assert broken == lost[np.isin(particles.slots, slots)].sum() == lost.sum() > 0


@pytest.mark.parametrize("path, dim", [("lattice", 2), ("cloud", 3)])
def test_weights_follow_a_ramp_and_bonds_of_whole_ends_are_whole(path, dim, intact_pairs):
    """Weight 1 where an end has ramp 1, else the mean: forces against a sum in numpy, divided by the mass share; stiffnesses likewise."""
    subdomain, law = shaken(path, "pmb", dim, True)
    particles, marked, bonds = subdomain.particles, marked_of(subdomain), shares_of(subdomain)
    slots = particles_of(subdomain, marked)
    ramp, x, u = np.zeros(len(subdomain.points.position)), subdomain.places(), particles.owned(particles.displacement)
    particles.put(ramp, np.minimum(1.0, 1.5 * x[:, 0] / x[:, 0].max()))
    share_by_ramp(bonds, ramp, slots)
    set_over_masses(bonds, slots, 1.0 / ramp[slots])
    forces, _ = forces_of(subdomain, law, bonds, marked)
    found = np.empty(len(slots))
    stiffnesses(bonds, subdomain.points, law, subdomain.state, slots, found)
    of_row, expected, stiffness = particles.owned(ramp), np.zeros((particles.n_owned, dim)), np.zeros(particles.n_owned)
    for i, j in intact_pairs(subdomain):
        xi = x[j] - x[i]
        weight = 1.0 if 1.0 in (of_row[i], of_row[j]) else 0.5 * (of_row[i] + of_row[j])
        pull = law.micromodulus[0, 0] * weight * 1e-3**dim / np.linalg.norm(xi)  # omega = beta = 1, a cell of 1 mm
        expected[i] += pull * (xi @ (u[j] - u[i])) * xi / (xi @ xi) / of_row[i]
        stiffness[i] += pull
    rows = np.searchsorted(particles.slots, slots) if path == "cloud" else [int(np.flatnonzero(particles.slots == slot)[0]) for slot in slots]
    assert (of_row == 1.0).any() and (of_row < 0.5).any()
    assert np.abs(forces[slots] - expected[rows]).max() < 1e-12 * np.abs(expected).max()
    assert np.allclose(found, stiffness[rows], rtol=1e-12)


@pytest.mark.parametrize("path, model, dim", KERNELS)
def test_the_sweep_without_the_marked_and_that_of_the_marked_are_the_whole(path, model, dim):
    """The seam as methods use it: a rank leaves rows out of its main sweep and sweeps them apart."""
    subdomain, law = shaken(path, model, dim, False)
    particles, everything, marked = subdomain.particles, np.concatenate(subdomain.rows), marked_of(subdomain)
    whole, _ = forces_of(subdomain, law, subdomain.bonds.arrays, everything)
    particles.force_density[:] = 0.0
    forces_of(subdomain, law, subdomain.bonds.arrays, np.setdiff1d(everything, marked).astype(np.int32))
    both, _ = forces_of(subdomain, law, shares_of(subdomain), marked)
    assert np.array_equal(particles.owned(both), particles.owned(whole))


def test_memory_is_that_of_the_marked():
    subdomain, _ = block(2, 7, 2.0)
    shares, rows = shares_of(subdomain), len(marked_of(subdomain))
    assert shares.weight.shape == (rows, len(subdomain.bonds.arrays.offset), 8) and shares.row.dtype == np.int32
    assert len(shares.row) == len(subdomain.points.position) // 8
