"""Who breaks: by numpy from the positions, on rows of one block and bond by bond alike."""
import itertools

import numpy as np
import pytest

from pdhpc.kernels import reference, sweeps
from pdhpc.kernels.family import MIXED, PointArrays
from pdhpc.kernels.neighbours import find_bonds
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.failure import PairEnergyLimit
from pdhpc.materials.influence import value
from pdhpc.materials.law import Setting
from pdhpc.materials.state_based import LinearSolid
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.warm_up import PATHS, NoGhosts, Variant, block

N, RADIUS = 300, 1.0


class Cloud:
    """Random particles of one volume, displaced at random, and what numpy says of every pair in reach."""

    def __init__(self, dim, linear, material, row_block):
        random = np.random.default_rng(5)
        x = random.uniform(0, 4 if dim == 2 else 2.2, (N, dim))
        u = random.uniform(-0.02, 0.02, (N, dim))
        self.setting = Setting("3d" if dim == 3 else "plane_strain", RADIUS, 1.0, "gaussian", 0.0, "none", bool(linear))
        self.law = type(material).law([(material, True)], self.setting)
        self.bonds, _ = find_bonds(x, np.arange(N), N, RADIUS)
        width = 2 if dim == 2 else 4
        reference, position = np.zeros((N, width)), np.zeros((N, width))
        reference[:, :dim], position[:, :dim] = x, u if linear else x + u
        self.volume = 0.01
        self.points = PointArrays(reference, position, np.full(N, self.volume), np.zeros(N, np.uint8), np.full(N, row_block, np.uint8), np.zeros(N))
        self.slots, self.linear, self.third, self.dim = np.arange(N, dtype=np.int32), linear, None if dim == 2 else 2, dim
        self.i, self.j = np.array([(i, self.bonds.neighbour[k]) for i in range(N) for k in self._row(i)]).T
        xi, eta = x[self.j] - x[self.i], u[self.j] - u[self.i]
        self.r = np.linalg.norm(xi, axis=1)
        self.s = np.einsum("nd,nd->n", xi, eta) / self.r**2 if linear else np.linalg.norm(xi + eta, axis=1) / self.r - 1

    def _row(self, i):
        return [k for k in range(self.bonds.row_start[i], self.bonds.row_start[i + 1]) if self.bonds.alive[k >> 3] >> (k & 7) & 1]

    def broken_pairs(self, state=None):
        """Return (n_pairs,) bool after one evaluation, and the energy dissipated."""
        force, dissipated = np.zeros((N, self.dim)), np.zeros(N)
        common = self.bonds, self.points, self.law, state, self.linear, self.third, self.slots
        if len(getattr(self.law.failure, "softening", [])):
            sweeps.smallest_stretches(*common, dissipated)
        if state is not None:
            sweeps.weighted_volumes(self.bonds, self.points, self.law, self.slots, state)
            assert not isinstance(self.law.failure, PairEnergyLimit) or sweeps.dilatations(*common, dissipated) == 0, "energies wait for the state of both ends"
        count = sweeps.bond_forces(*common, force, dissipated)
        left = {(i, int(self.bonds.neighbour[k])) for i in range(N) for k in self._row(i)}
        broken = np.array([(i, j) not in left for i, j in zip(self.i, self.j)])
        assert count == broken.sum() and 20 < count < len(broken) / 2, "a case that tests something"
        assert np.array_equal(broken, np.array([(j, i) not in left for i, j in zip(self.i, self.j)])), "at both ends or at none"
        return broken, dissipated


def held_by_linear_solid(cloud, material, s):
    """Return the energy of the cloud, J, whose bonds have the stretches s: V sum_i (k - (d + 2) G/d) theta^2/2 + d (d + 2) G/(2 m) sum omega (s r)^2 V."""
    d, k, shear = cloud.dim, material.bulk(cloud.setting), material.shear_modulus
    part = value("gaussian", cloud.r, RADIUS) * cloud.r**2 * cloud.volume
    m, theta, squares = (np.bincount(cloud.i, part * power, N) for power in (np.ones(len(s)), s, s**2))
    return cloud.volume * np.sum(0.5 * (k - (d + 2) * shear / d) * (d * theta / m) ** 2 + d * (d + 2) * shear / (2 * m) * squares)


CHOICES = list(itertools.product((2, 3), (None, True), (0, MIXED)))


@pytest.mark.parametrize("dim, linear, row_block", CHOICES)
def test_bond_based_bonds_break_at_their_energy(dim, linear, row_block):
    material = BondBased("a", 1.0, 2.0, 5e-4, failure="energy")
    cloud = Cloud(dim, linear, material, row_block)
    omega = value("gaussian", cloud.r, RADIUS)
    energy = 0.5 * material.micromodulus(cloud.setting) * omega * cloud.s**2 * cloud.r
    critical = 4 * 5e-4 / np.pi if dim == 3 else 1.5 * 5e-4
    broken, dissipated = cloud.broken_pairs()
    assert np.array_equal(broken, (energy > critical) & (cloud.s > 0)) and ((energy > critical) & (cloud.s < 0)).any()
    assert dissipated.sum() == pytest.approx(0.5 * critical * cloud.volume**2 * broken.sum(), rel=1e-12), "w_c of each bond, half of it at either end"


@pytest.mark.parametrize("dim, linear, row_block", CHOICES)
def test_state_based_bonds_break_at_half_their_pull_times_elongation(dim, linear, row_block):
    material = LinearSolid("a", 1.0, 3.0, 0.7, 3e-4, failure="energy")
    cloud = Cloud(dim, linear, material, row_block)
    i, j, r, s = cloud.i, cloud.j, cloud.r, cloud.s
    omega, k, shear = value("gaussian", r, RADIUS), material.bulk(cloud.setting), material.shear_modulus
    m = np.bincount(i, omega * r**2 * cloud.volume, N)
    theta = dim / m * np.bincount(i, omega * r**2 * s * cloud.volume, N)
    state = [((dim * k - (dim + 2) * shear) * theta[end] * r + dim * (dim + 2) * shear * s * r) / m[end] for end in (i, j)]
    energy = 0.5 * omega * (state[0] + state[1]) * s * r
    critical = 4 * 3e-4 / np.pi if dim == 3 else 1.5 * 3e-4
    broken, dissipated = cloud.broken_pairs(np.zeros((N, 2)))
    assert np.array_equal(broken, (energy > critical) & (s > 0))
    at = np.where(broken, s * np.sqrt(critical / np.where(broken, energy, 1.0)), s)  # they stored w_c when all strains were smaller by that
    drop = held_by_linear_solid(cloud, material, at) - held_by_linear_solid(cloud, material, np.where(broken, 0.0, s))
    assert dissipated.sum() == pytest.approx(drop, rel=1e-9)


@pytest.mark.parametrize("dim, linear, row_block", CHOICES)
@pytest.mark.parametrize("material", [
    BondBased("a", 1.0, 2.0, critical_stretch=0.03, stretch_softening=0.25), LinearSolid("a", 1.0, 3.0, 0.7, critical_stretch=0.03, stretch_softening=0.25),
])
def test_compression_raises_the_critical_stretch(material, dim, linear, row_block):
    cloud = Cloud(dim, linear, material, row_block)
    smallest = np.zeros(N)
    np.minimum.at(smallest, cloud.i, cloud.s)
    own = 0.03 - 0.25 * smallest
    limit = np.minimum(own[cloud.i], own[cloud.j])
    broken, dissipated = cloud.broken_pairs(np.zeros((N, 2)) if isinstance(material, LinearSolid) else None)
    assert np.array_equal(broken, cloud.s > limit) and ((cloud.s > 0.03) & ~broken).sum() > 10
    assert np.allclose(cloud.points.raised, -0.25 * smallest, rtol=1e-9, atol=1e-15)
    if isinstance(material, BondBased):
        energy = 0.25 * material.micromodulus(cloud.setting) * value("gaussian", cloud.r, RADIUS) * limit**2 * cloud.r * cloud.volume**2
        assert dissipated.sum() == pytest.approx(energy[broken].sum(), rel=1e-9)
    else:
        drop = held_by_linear_solid(cloud, material, np.minimum(cloud.s, limit)) - held_by_linear_solid(cloud, material, np.where(broken, 0.0, cloud.s))
        assert dissipated.sum() == pytest.approx(drop, rel=1e-9)


@pytest.mark.parametrize("row_block", [0, MIXED])
@pytest.mark.parametrize("material, linear", [
    (BondBased("a", 1.0, 2.0, critical_stretch=0.03, weibull_modulus=4.0), True), (LinearSolid("a", 1.0, 3.0, 0.7, critical_stretch=0.03, weibull_modulus=4.0), None),
])
def test_the_weaker_end_of_a_bond_counts_where_strengths_scatter(material, linear, row_block):
    cloud = Cloud(2, linear, material, row_block)
    strength = np.random.default_rng(3).uniform(0.3, 1.7, N)
    cloud.points = cloud.points._replace(strength=strength)
    limit = 0.03 * np.minimum(strength[cloud.i], strength[cloud.j])
    broken, dissipated = cloud.broken_pairs(np.zeros((N, 2)) if isinstance(material, LinearSolid) else None)
    assert np.array_equal(broken, cloud.s > limit) and ((cloud.s > 0.03) & ~broken).sum() > 10 and ((cloud.s < 0.03) & broken).sum() > 10
    if isinstance(material, BondBased):
        energy = 0.25 * material.micromodulus(cloud.setting) * value("gaussian", cloud.r, RADIUS) * limit**2 * cloud.r * cloud.volume**2
        assert dissipated.sum() == pytest.approx(energy[broken].sum(), rel=1e-9), "the energy at its own critical stretch"


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model, linear", [("pmb", True), ("lps", False)])
def test_one_particle_of_less_scatter_loses_its_bonds_at_both_ends(path, model, linear):
    """At half of the critical stretch everywhere, a particle of a third of the strength breaks free, and each neighbour loses one bond."""
    subdomain, law = block(2, 24, 2.5, linear, path, model, Variant(modulus=3.0))
    particles, x = subdomain.particles, subdomain.places()
    weak = int(np.argmin(np.linalg.norm(x - [12.5e-3, 11.5e-3], axis=1)))
    subdomain.points.strength[:] = 1.0
    subdomain.points.strength[particles.slots[weak]] = 1 / 3
    particles.put(particles.displacement, 0.5 * law.critical_stretch[0, 0] * x)
    particles.place()
    before = subdomain.bonds.alive()
    r = np.linalg.norm(x - x[weak], axis=1)
    InternalForces(subdomain, law, NoGhosts).evaluate()
    lost = np.where((r > 0) & (r < 2.5e-3 * (1 + 1e-6)), 1, 0)
    lost[weak] = lost.sum()
    assert lost[weak] == 20 and np.array_equal(before - subdomain.bonds.alive(), lost)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model, linear", [("pmb", True), ("lps", False)])
def test_scatter_on_both_paths(path, model, linear):
    """Every bond by numpy, from all pairs in reach."""
    subdomain, law = block(2, 12, 2.5, linear, path, model, Variant(modulus=3.0))
    particles, x = subdomain.particles, subdomain.places()
    u = 1e-5 * np.random.default_rng(1).standard_normal(x.shape)
    particles.put(particles.displacement, u)
    particles.place()
    strength = particles.owned(subdomain.points.strength)
    xi, eta = x[None] - x[:, None], u[None] - u[:, None]
    r = np.linalg.norm(xi, axis=2)
    bonded = (r > 0) & (r < 2.5e-3 * (1 + 1e-6))
    r[~bonded] = 1.0
    s = np.einsum("ijd,ijd->ij", xi, eta) / r**2 if linear else np.linalg.norm(xi + eta, axis=2) / r - 1
    limit = law.critical_stretch[0, 0] * np.minimum(strength[:, None], strength[None])
    intact = bonded & (s <= limit)
    InternalForces(subdomain, law, NoGhosts).evaluate()
    assert np.array_equal(subdomain.bonds.alive(), intact.sum(axis=1)) and 0.02 < 1 - intact.sum() / bonded.sum() < 0.9
    assert strength.std() == pytest.approx(0.363, rel=0.2) and (bonded & (s > law.critical_stretch[0, 0]) & intact).any()


@pytest.mark.parametrize("row_block", [0, MIXED])
@pytest.mark.parametrize("linear", [None, True])
@pytest.mark.parametrize("model", ["pmb", "lps"])
def test_one_bond_just_below_and_just_beyond_its_energy(model, linear, row_block):
    """Two particles at distance r; lps at 3 K = 5 G, where no dilatation enters: m = omega r^2 V, a = 15 G/m, w = omega (2 a) (s r)^2/2 = 15 G s^2/V."""
    r, volume, shear, critical = 0.8, 0.02, 0.7, 4 * 2e-3 / np.pi
    material = BondBased("a", 1.0, 2.0, 2e-3, failure="energy") if model == "pmb" else LinearSolid("a", 1.0, 5 / 3 * shear, shear, 2e-3, failure="energy")
    setting = Setting("3d", 1.0, 1.0, "gaussian", 0.0, "none", bool(linear))
    stretch = np.sqrt(critical * volume / (15 * shear))
    if model == "pmb":
        stretch = np.sqrt(2 * critical / (material.micromodulus(setting) * np.exp(-(r**2)) * r))
    for factor, broken in ((1 - 1e-6, 0), (1 + 1e-6, 2)):
        reference, position = np.zeros((2, 4)), np.zeros((2, 4))
        reference[1, 0], position[1, 0] = r, stretch * factor * r + (0 if linear else r)
        bonds, _ = find_bonds(reference[:, :3].copy(), np.arange(2), 2, 1.0)
        points = PointArrays(reference, position, np.full(2, volume), np.zeros(2, np.uint8), np.full(2, row_block, np.uint8))
        law, slots, state = type(material).law([(material, True)], setting), np.arange(2, dtype=np.int32), None
        if model == "lps":
            state = np.zeros((2, 2))
            sweeps.weighted_volumes(bonds, points, law, slots, state)
            sweeps.dilatations(bonds, points, law, state, linear, 2, slots, np.zeros(2))
        assert sweeps.bond_forces(bonds, points, law, state, linear, 2, slots, np.zeros((2, 3)), np.zeros(2)) == broken


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("linear", [False, True])
def test_compression_eight_bonds_at_a_time_and_one_by_one_has_the_same_bits(path, linear):
    subdomain, law = block(2, 9, 3.0, linear, path, variant=Variant(softening=0.25))
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    particles.put(particles.displacement, 1e-5 * np.random.default_rng(1).standard_normal((81, 2)))
    particles.place()
    particles.put(particles.displacement, np.zeros((81, 2)))
    break_bond_of = arrays.alive if path == "cloud" else arrays.alive.ravel()
    break_bond_of[::5] &= break_bond_of.dtype.type(0b10110111)
    rows, found = np.concatenate(subdomain.rows), []
    for sweep in (sweeps.smallest_stretches, reference.smallest_stretches):
        subdomain.points.raised[:] = -1.0
        assert sweep(arrays, subdomain.points, law, None, particles.linear, None, rows, particles.dissipated) == 0
        found.append(particles.owned(subdomain.points.raised).copy())
    assert np.array_equal(*found) and found[0].min() >= 0 and found[0].max() > 1e-4
