"""The mass matrix of the patches against a dense one."""
import numpy as np
import pytest

from pdhpc.gfem.patch_mass import PatchMass
from pdhpc.gfem.patches import Patches
from pdhpc.study.verify.case import plate, problem_of


@pytest.fixture(scope="module")
def parts():
    return problem_of('model = "gfem"\n' + plate((24, 16), extra="[mesh]\ncell_size = 4.0\n")).coupled_parts


def follow(parts, cells):
    """Return (Patches, PatchMass, lumped mass outside) with patches of the marked cells."""
    mesh, material = parts.mesh, parts.material
    patches = Patches(mesh, np.zeros(24, bool))
    patches.add(cells)
    outside = np.zeros(len(mesh.points))
    for cell in np.flatnonzero(~patches.enriched):
        outside[mesh.cells[cell]] += material.lumped[material.kind[cell]]
    mass = PatchMass(parts.comm, mesh, material)
    mass.follow(patches, outside)
    return patches, mass, outside


def dense(parts, patches, outside):
    matrix = np.diag(outside)
    for cell in np.flatnonzero(patches.enriched):
        corners = parts.mesh.cells[cell]
        matrix[np.ix_(corners, corners)] += parts.material.consistent[parts.material.kind[cell]]
    return matrix


@pytest.mark.parametrize("chosen", ([0], [9, 10], list(range(24))))
def test_solution_is_the_dense_one(parts, chosen):
    patches, mass, outside = follow(parts, np.isin(np.arange(24), chosen))
    matrix = dense(parts, patches, outside)
    assert matrix.sum() == pytest.approx(24 * 16.0), "the body's mass"
    assert np.array_equal(mass.inner, np.flatnonzero(patches.touched(patches.enriched)))
    right = np.random.default_rng(1).uniform(-1, 1, parts.mesh.points.shape)
    change = np.full(right.shape, 7.0)
    mass.solve(right, change)
    expected = np.linalg.solve(matrix, right)
    assert change[mass.inner] == pytest.approx(expected[mass.inner], abs=1e-11 * np.abs(expected).max())
    others = np.setdiff1d(np.arange(len(right)), mass.inner)
    assert np.all(change[others] == 7.0) and mass.failure is None and 0 < mass.iterations < 60
    block = matrix[np.ix_(mass.inner, mass.inner)]
    scale = 1.0 / np.sqrt(np.diag(block))
    values = np.linalg.eigvalsh(block * scale * scale[:, None])
    assert mass.condition() == pytest.approx(values[-1] / values[0], rel=0.02)
    along = 3 / (1 - 1 / 4**2)  # of one line: 4 particles integrate x^2 to 1/3 - 1/(12 4^2), x (1 - x) to the rest of 1/2
    assert values[-1] / values[0] <= along**2 * (1 + 1e-12)


def test_no_patch_no_system(parts):
    _, mass, _ = follow(parts, np.zeros(24, bool))
    change = np.full(parts.mesh.points.shape, 7.0)
    mass.solve(np.ones_like(change), change)
    assert len(mass.inner) == 0 and np.all(change == 7.0) and mass.condition() == 1.0
