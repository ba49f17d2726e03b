"""Stiffnesses of cells from the bonds of their particles."""
import math

import numpy as np
import pytest

from pdhpc.fem.moduli import isotropic
from pdhpc.gfem.lattice_material import LatticeMaterial, add_kind_forces, cell_stiffness, kind_energies
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.study.verify.case import plate, problem_of


@pytest.fixture(scope="module")
def parts():
    return problem_of('model = "gfem"\n' + plate((28, 20), extra="[mesh]\ncell_size = 4.0\n")).coupled_parts


def whole(material):
    """Return (n_kinds, 8, 8), the stiffnesses of cells where alpha is 0, the first of the 16 ramps of each kind."""
    return material.stiffness[::16]


def rigid(x):
    """Translations and a small rotation of vertices (n, 2), (3, n, 2)."""
    one, none = np.ones(len(x)), np.zeros(len(x))
    return np.array([np.stack([one, none], axis=1), np.stack([none, one], axis=1), np.stack([-x[:, 1], x[:, 0]], axis=1)])


def test_cells_of_equal_bonds_share_a_kind(parts):
    """7 x 5 cells, a family reaches into the next one: kinds are told apart by the distances to the edges, up to one cell."""
    material, mesh = parts.material, parts.mesh
    column, row = np.rint((mesh.points[mesh.cells[:, 0]] - (-14.0, -10.0)) / 4.0).astype(int).T
    place = [(min(i, 1) - min(6 - i, 1), min(j, 1) - min(4 - j, 1)) for i, j in zip(column, row)]
    found = {}
    for kind, where in zip(material.kind.tolist(), place):
        assert found.setdefault(where, kind) == kind
    assert len(found) == len(set(found.values())) == len(whole(material)) == 9


def test_masses(parts):
    material = parts.material
    assert material.lumped == pytest.approx(np.full((9, 4), 4.0)), "16 particles of unit mass in each cell, by symmetry the same on each corner"
    assert material.consistent.sum(axis=2) == pytest.approx(material.lumped) and np.array_equal(material.consistent, material.consistent.transpose(0, 2, 1))
    expected = np.einsum("pa,pb->ab", parts.lattice.shape, parts.lattice.shape)
    assert material.consistent == pytest.approx(np.broadcast_to(expected, (9, 4, 4)))


def test_rigid_motions_cost_nothing(parts):
    material, corners = parts.material, parts.mesh.points[parts.mesh.cells[0]]
    largest = np.abs(material.stiffness).max()
    for motion in rigid(corners):
        assert np.abs(material.stiffness @ motion.ravel()).max() < 1e-13 * largest
    assert material.stiffness == pytest.approx(material.stiffness.transpose(0, 2, 1), abs=1e-14 * largest)
    values = np.linalg.eigvalsh(whole(material))
    assert np.all(np.abs(values[:, :3]) < 1e-13 * largest) and np.all(values[:, 3:] > 1e-3 * largest)


def test_uniform_strain_stores_in_elements_what_it_stores_in_particles(parts):
    """Of every cell, those at the edges too, whose particles lack neighbours."""
    material, mesh, subdomain, law = parts.material, parts.mesh, parts.part.subdomain, parts.body.law
    gradient = np.array([[1e-3, 4e-4], [-7e-4, -3e-4]])
    energy, cells = np.empty(35), np.arange(35, dtype=np.int32)
    kind_energies(mesh.cells, cells, material.kind, np.ascontiguousarray(whole(material)), mesh.points @ gradient.T, energy)
    particles = subdomain.particles
    kept = particles.position.copy()
    particles.position[particles.slots] = subdomain.places() @ gradient.T
    density = np.zeros(len(particles.position))
    density[particles.slots] = strain_energy_density(subdomain, law)
    particles.position[:] = kept
    expected = density[parts.lattice.slots_of(cells)].sum(axis=1)
    assert energy == pytest.approx(expected, rel=1e-11) and expected.max() > 1.2 * expected.min()


def test_two_materials_are_seen_across_their_interface():
    """Cells on either side of it have intact bonds only, as those inside, but of other moduli: C_p from the bonds, by hand, of every particle."""
    extra = '[mesh]\ncell_size = 4.0\n[[material]]\nname = "hard"\ndensity = 1.0\nyoungs_modulus = 5.0\ncritical_stretch = 0.01\n'
    extra += '[[body]]\nname = "b"\nmaterial = "hard"\nshape = "box"\nlower = [14.0, -10.0]\nupper = [42.0, 10.0]\n'
    problem = problem_of('model = "gfem"\n' + plate((28, 20), extra=extra))
    material, lattice, law = problem.coupled_parts.material, problem.coupled_parts.lattice, problem.coupled_parts.body.law
    subdomain = problem.coupled_parts.part.subdomain
    slots = lattice.slots_of(np.arange(len(material.kind), dtype=np.int32))
    index, block = np.rint(subdomain.places_at(slots.ravel()) - 0.5).astype(int), subdomain.particles.block[slots.ravel()]
    there = dict(zip(map(tuple, index.tolist()), block.tolist()))
    expected = np.zeros((len(index), 3, 3))
    for m in range(-3, 4):
        for n in range(-3, 4):
            r = math.hypot(m, n)
            if 0 < r < 3.5:
                v = np.array([m * m, n * n, m * n]) / r**2
                partner = [there.get((i + m, j + n), -1) for i, j in index.tolist()]
                c = np.array([law.micromodulus[a, b] if b >= 0 else 0.0 for a, b in zip(block, partner)])
                expected += (0.5 * c * min(1.0, 3.5 - r) * r)[:, None, None] * np.outer(v, v)
    soft, hard = sorted(set(block))
    assert law.micromodulus[soft, soft] < law.micromodulus[soft, hard] < law.micromodulus[hard, hard]
    assert material.moduli[material.kind].reshape(-1, 3, 3) == pytest.approx(expected, abs=1e-12)


def test_moduli_inside_are_those_of_the_lattice(parts):
    """C_p of a whole family is one for all, a sum over the square lattice; test_blend.py sums it for one of 3.015 spacings."""
    material = parts.material
    inner = material.moduli[material.kind[17]]
    assert inner == pytest.approx(np.broadcast_to(inner[0], inner.shape), rel=1e-12, abs=1e-15)
    expected, c = np.zeros((3, 3)), parts.body.law.micromodulus[0, 0]
    for m in range(-3, 4):
        for n in range(-3, 4):
            r = math.hypot(m, n)
            if 0 < r < 3.5:
                v = np.array([m * m, n * n, m * n]) / r**2
                expected += 0.5 * c * min(1.0, 3.5 - r) * r * np.outer(v, v)
    assert inner[0] == pytest.approx(expected, abs=1e-12)
    assert inner[0][0, 0] > 1.05 * material.moduli[:, :, 0, 0].min()


def test_continuum_moduli_take_their_place(parts):
    moduli = isotropic(2.0, 0.3, "plane_stress")
    material = LatticeMaterial(parts.lattice, parts.part.subdomain, parts.body.law, np.array([moduli] * len(parts.body.blocks)))
    assert np.all(material.moduli == moduli)
    assert whole(material) == pytest.approx(np.broadcast_to(material.stiffness[0], (9, 8, 8)), rel=1e-14)
    extension = (parts.mesh.points[parts.mesh.cells[3]] * (1.0, 0.0)).ravel()
    assert extension @ material.stiffness[0] @ extension == pytest.approx(16.0 * moduli[0, 0]), "a cell of 4 x 4 under unit strain"


def test_ramped_cells_lose_what_the_particles_take(parts):
    """Corners where alpha is 1, in any of 16 ways: each particle counts with 1 - sum of the functions of these corners."""
    material, mesh, lattice = parts.material, parts.mesh, parts.lattice
    weight = (np.random.default_rng(4).uniform(size=len(mesh.points)) < 0.5).astype(float)
    entry, acting = material.ramped_kind(weight)
    at_corners = weight[mesh.cells]
    assert np.array_equal(acting, ~at_corners.all(axis=1)) and np.array_equal(entry // 16, material.kind) and len(set(entry % 16)) > 8
    outside = 1.0 - at_corners @ lattice.shape.T
    expected = np.zeros((35, 8, 8))
    cell_stiffness(lattice.gradient, material.moduli, material.kind, outside, 1.0, expected)
    assert material.stiffness[entry] == pytest.approx(expected, abs=1e-13)
    assert np.all(material.ramped_kind(np.ones(len(mesh.points)))[0] % 16 == 15) and np.abs(material.stiffness[15::16]).max() < 1e-14


def test_stiffness_in_three_dimensions():
    """Random moduli: B from gradients by hand, in the order xx, yy, zz, yz, xz, xy."""
    random = np.random.default_rng(5)
    gradient, half = random.uniform(-1, 1, (2, 8, 3)), random.uniform(-1, 1, (1, 2, 6, 6))
    moduli, weight = half + half.transpose(0, 1, 3, 2), np.array([[0.3, 0.8]])
    result, expected = np.zeros((1, 24, 24)), np.zeros((24, 24))
    cell_stiffness(gradient, moduli, np.zeros(1, np.int32), weight, 0.5, result)
    for p in range(2):
        b = np.zeros((6, 24))
        for row, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]):
            for a in range(8):
                for d in range(3):
                    slope = np.zeros((3, 3))
                    slope[d] = gradient[p, a]
                    b[row, 3 * a + d] = slope[i, i] if i == j else slope[i, j] + slope[j, i]
        expected += 0.5 * weight[0, p] * b.T @ moduli[0, p] @ b
    assert result[0] == pytest.approx(expected, abs=1e-13)


def test_forces_are_minus_stiffness_times_displacement(parts):
    material, mesh = parts.material, parts.mesh
    displacement = np.random.default_rng(6).uniform(-1, 1, mesh.points.shape)
    chosen, entry = np.array([3, 20, 4], np.int32), (16 * material.kind + 3).astype(np.int32)
    expected, force = np.full((2, *mesh.points.shape), 0.5)
    for cell in chosen:
        expected[mesh.cells[cell]] -= (material.stiffness[entry[cell]] @ displacement[mesh.cells[cell]].ravel()).reshape(4, 2)
    add_kind_forces(mesh.cells, chosen, entry, material.stiffness, displacement, force, np.zeros(8))
    assert force == pytest.approx(expected, abs=1e-12)
    energy = np.empty(3)
    kind_energies(mesh.cells, chosen, entry, material.stiffness, displacement, energy)
    assert 2 * energy.sum() == pytest.approx(-((expected - 0.5) * displacement).sum(), rel=1e-12)
