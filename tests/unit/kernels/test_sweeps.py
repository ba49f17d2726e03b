"""Forces, dilatations and energies against an independent numpy sum, on both storages of bonds, and vectors against bond by bond."""
import itertools

import numpy as np
import pytest

from pdhpc.geometry.lattice import LatticeBody, find_common_lattice
from pdhpc.geometry.shapes import Box
from pdhpc.kernels import reference, sweeps
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting
from pdhpc.materials.state_based import LinearSolid
from pdhpc.parallel.partition import Partition
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.peridynamics.lattice_subdomain import make_lattice_subdomain
from pdhpc.peridynamics.subdomain import make_subdomain

WHOLE = Partition(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), 1)
CHOICES = list(itertools.product(("lattice", "cloud"), ("pmb", "lps"), (2, 3), (False, True)))


def solid(model, name="a", stiffness=1.0, **strength):
    if model == "pmb":
        return BondBased(name, 2.0 + stiffness, 3.0 * stiffness, **strength)
    return LinearSolid(name, 2.0 + stiffness, 2.0 * stiffness, 0.7 * stiffness, **strength)


def deformed(path, model, dim, linear, blocks=1, influence="inverse_distance", correction="linear", strength=None):
    """Return (subdomain, law, setting) of a box of particles displaced at random, some bonds broken, halves of different material when blocks is 2."""
    cells, spacing, horizon = ((9, 7, 11) if dim == 3 else (14, 19)), 0.5, 1.25
    body = LatticeBody(Box((0.0,) * dim, tuple(spacing * c for c in cells)), spacing, 0)
    setting = Setting("3d" if dim == 3 else "plane_strain", horizon, 1.0, influence, spacing, correction, linear)
    materials = [(solid(model, str(n), 1.0 + n, **(strength or {})), True) for n in range(blocks)]
    law = type(materials[0][0]).law(materials, setting)
    radius = (horizon + spacing / 2) * (1 - 1e-9) if correction == "linear" else horizon * (1 + 1e-9)

    def describe(points, number, ids):
        return np.full(len(points), spacing**dim), (points[:, -1] > 2.4).astype(np.uint8) * (blocks - 1)

    if path == "lattice":
        subdomain = make_lattice_subdomain([body], find_common_lattice([body])[0], WHOLE, 0, radius, describe, law, linear)
    else:
        subdomain = make_subdomain([body], WHOLE, 0, radius, describe, linear)
    subdomain.make_state(law)
    particles = subdomain.particles
    random = np.random.default_rng(7)
    particles.put(particles.displacement, random.uniform(-0.02, 0.02, (particles.n_owned, dim)))
    particles.place()
    broken = {tuple(sorted(pair)) for pair in random.integers(0, particles.n_owned, (400 * dim, 2))}
    row_of = {int(slot): row for row, slot in enumerate(particles.slots)}
    for row, k, other in each_bond(subdomain, row_of):
        if tuple(sorted((row, other))) in broken or (row + other) % 11 == 0:
            kill(subdomain, row, k)
    return subdomain, law, setting


def each_bond(subdomain, row_of):
    """Return [(owned row, k, owned row of the other end)] of intact bonds."""
    arrays, found = subdomain.bonds.arrays, []
    for row, slot in enumerate(subdomain.particles.slots):
        if hasattr(arrays, "offset"):
            ks = [k for k in range(len(arrays.offset)) if int(arrays.alive[k >> 6, slot]) >> (k & 63) & 1]
            found += [(row, k, row_of[int(slot + arrays.offset[k])]) for k in ks]
        else:
            ks = [k for k in range(arrays.row_start[row], arrays.row_start[row + 1]) if arrays.alive[k >> 3] >> (k & 7) & 1]
            found += [(row, k, int(arrays.neighbour[k])) for k in ks]
    return found


def kill(subdomain, row, k):
    arrays, slot = subdomain.bonds.arrays, subdomain.particles.slots[row]
    if hasattr(arrays, "offset"):
        arrays.alive[k >> 6, slot] &= ~(np.uint64(1) << np.uint64(k & 63))
    else:
        arrays.alive[k >> 3] &= ~np.uint8(1 << (k & 7))


def numpy_forces(subdomain, setting, materials, linear):
    """Return (force density, energy density) by the formulas of the papers, over pairs found by distance, with the states of the subdomain's bonds."""
    particles, x = subdomain.particles, subdomain.places()
    row_of = {int(slot): row for row, slot in enumerate(particles.slots)}
    bonds = np.array([(row, other) for row, _, other in each_bond(subdomain, row_of)])
    i, j = bonds.T
    u = particles.owned(particles.displacement)
    xi, eta = x[j] - x[i], u[j] - u[i]
    r = np.linalg.norm(xi, axis=1)
    y = xi + eta
    extension = (xi * eta).sum(axis=1) / r if linear else np.linalg.norm(y, axis=1) - r
    direction = xi / r[:, None] if linear else y / np.linalg.norm(y, axis=1)[:, None]
    volume = setting.spacing ** x.shape[1]
    omega = setting.horizon / r * np.minimum(1.0, (setting.horizon + setting.spacing / 2 - r) / setting.spacing)
    block = particles.owned(particles.block)
    n, d = len(x), x.shape[1]

    def summed(values):
        return np.bincount(i, values, n)

    if isinstance(materials[0], BondBased):
        c = np.array([material.micromodulus(setting) for material in materials])[block]
        pair = 2 / (1 / c[i] + 1 / c[j])
        tension = pair * omega * extension / r
        energy = summed(0.25 * pair * omega * extension**2 / r * volume)
    else:
        k = np.array([m.bulk_modulus + (0 if d == 3 else m.shear_modulus / 3) for m in materials])[block]
        g = np.array([m.shear_modulus for m in materials])[block]
        whole = np.array([weighted_volume(x, at, setting) for at in x])
        theta = d / whole * summed(omega * r * extension * volume)
        t = lambda end: omega / whole[end] * ((d * k - (d + 2) * g)[end] * theta[end] * r + (d * (d + 2) * g)[end] * extension)  # noqa: E731
        tension = t(i) + t(j)
        energy = lps_energy(d, k, g, whole, i, r, omega * volume, extension)
    force = np.stack([summed(tension * direction[:, axis] * volume) for axis in range(d)], axis=1)
    return force, energy


def lps_energy(d, k, g, whole, i, r, share, extension):
    """Return W = (k - (d + 2) G/d) theta^2/2 + d (d + 2) G/(2 m) sum omega e^2 V of each particle; share: omega V of each bond."""
    theta = d / whole * np.bincount(i, share * r * extension, len(whole))
    return 0.5 * (k - (d + 2) * g / d) * theta**2 + d * (d + 2) * g / (2 * whole) * np.bincount(i, share * extension**2, len(whole))


def weighted_volume(x, at, setting):
    r = np.linalg.norm(x - at, axis=1)
    r = r[(r > 0) & (r < setting.horizon + setting.spacing / 2 - 1e-9)]
    beta = np.minimum(1.0, (setting.horizon + setting.spacing / 2 - r) / setting.spacing)
    return float(np.sum(setting.horizon / r * beta * r**2) * setting.spacing ** x.shape[1])


def evaluate(module, subdomain, law):
    """Return (force density of owned particles, bonds broken) by the sweeps of `module`."""
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    rows, broken = np.concatenate(subdomain.rows), 0
    arguments = arrays, subdomain.points, law, subdomain.state, particles.linear, particles.third, rows
    if subdomain.state is not None:
        broken += module.dilatations(*arguments, particles.dissipated)
    broken += module.bond_forces(*arguments, particles.force_density, particles.dissipated)
    return particles.owned(particles.force_density).copy(), broken


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
@pytest.mark.parametrize("blocks", (1, 2))
def test_forces_and_energies_are_those_of_numpy(path, model, dim, linear, blocks):
    subdomain, law, setting = deformed(path, model, dim, linear, blocks)
    expected, energy = numpy_forces(subdomain, setting, [solid(model, str(n), 1.0 + n) for n in range(blocks)], linear)
    force, broken = evaluate(sweeps, subdomain, law)
    assert broken == 0
    assert np.abs(force - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.allclose(strain_energy_density(subdomain, law), energy, rtol=1e-11, atol=1e-13 * energy.max())


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
@pytest.mark.parametrize("blocks", (1, 2))
def test_vectors_agree_with_the_readable_twin_while_bonds_break(path, model, dim, linear, blocks):
    results = []
    for module in (sweeps, reference):
        subdomain, law, _ = deformed(path, model, dim, linear, blocks, strength={"critical_stretch": 0.03})
        force, broken = evaluate(module, subdomain, law)
        results.append((force, broken, subdomain.bonds.alive(), subdomain.particles.owned(subdomain.particles.dissipated)))
    (force, broken, alive, dissipated), (twin, twin_broken, twin_alive, twin_dissipated) = results
    assert broken == twin_broken > 100 and broken % 2 == 0
    assert np.array_equal(alive, twin_alive)
    assert np.abs(force - twin).max() < 1e-12 * np.abs(twin).max()
    assert np.allclose(dissipated, twin_dissipated, rtol=1e-11)


@pytest.mark.parametrize("path, model, dim, linear", CHOICES)
def test_forces_are_the_derivative_of_the_energy(path, model, dim, linear):
    subdomain, law, setting = deformed(path, model, dim, linear)
    force, _ = evaluate(sweeps, subdomain, law)
    particles, volume = subdomain.particles, setting.spacing**dim
    direction = np.random.default_rng(3).standard_normal(force.shape)
    start, energies, step = particles.owned(particles.displacement).copy(), [], 1e-6
    for sign in (1, -1):
        particles.put(particles.displacement, start + sign * step * direction)
        particles.place()
        energies.append(strain_energy_density(subdomain, law).sum() * volume)
    slope = (energies[0] - energies[1]) / (2 * step)
    assert slope == pytest.approx(-(force * direction).sum() * volume, rel=1e-7)  # central differences: step^2 and round-off / step


@pytest.mark.parametrize("path, dim, linear", list(itertools.product(("lattice", "cloud"), (2, 3), (False, True))))
def test_lps_dissipates_what_goes_with_its_bonds_at_the_critical_stretch(path, dim, linear):
    """The drop of W when the bonds beyond s0 leave it at s0, where all others stay as they are."""
    subdomain, law, setting = deformed(path, "lps", dim, linear, strength={"critical_stretch": 0.03})
    particles, x = subdomain.particles, subdomain.places()
    i, j = np.array([(row, other) for row, _, other in each_bond(subdomain, {int(slot): row for row, slot in enumerate(particles.slots)})]).T
    xi, eta = x[j] - x[i], particles.owned(particles.displacement)[j] - particles.owned(particles.displacement)[i]
    r, volume = np.linalg.norm(xi, axis=1), setting.spacing**dim
    s = (xi * eta).sum(axis=1) / r**2 if linear else np.linalg.norm(xi + eta, axis=1) / r - 1
    share = setting.horizon / r * np.minimum(1.0, (setting.horizon + setting.spacing / 2 - r) / setting.spacing) * volume
    solids = dim, solid("lps").bulk(setting), solid("lps").shear_modulus, np.array([weighted_volume(x, at, setting) for at in x]), i, r, share
    drop = (lps_energy(*solids, np.minimum(s, 0.03) * r) - lps_energy(*solids, np.where(s > 0.03, 0.0, s) * r)) * volume
    _, broken = evaluate(sweeps, subdomain, law)
    assert broken == (s > 0.03).sum() > 100
    assert np.allclose(particles.owned(particles.dissipated), drop, rtol=1e-9, atol=1e-13 * drop.max())


@pytest.mark.parametrize("model, dim, linear", list(itertools.product(("pmb", "lps"), (2, 3), (False, True))))
def test_both_storages_hold_the_same_model(model, dim, linear):
    results = []
    for path in ("lattice", "cloud"):
        subdomain, law, _ = deformed(path, model, dim, linear, 2, "gaussian", strength={"critical_stretch": 0.03})
        force, broken = evaluate(sweeps, subdomain, law)
        results.append((force, broken, subdomain.bonds.alive()))
    assert results[0][1] == results[1][1] > 100
    assert np.array_equal(results[0][2], results[1][2])
    assert np.abs(results[0][0] - results[1][0]).max() < 1e-12 * np.abs(results[1][0]).max()
