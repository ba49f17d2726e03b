"""Patches on a box of 5 x 3 unit cells: which vertices join, which cells that enriches."""
import numpy as np
import pytest

from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.mesh import cell_partition, make_box_mesh
from pdhpc.gfem.patches import Patches, largest_principal_strains

COUNTS = (5, 3)


@pytest.fixture
def mesh(comm):
    lower, upper = np.zeros(2), np.array(COUNTS, float)
    return make_box_mesh(comm, lower, upper, COUNTS, cell_partition(comm, lower, upper, COUNTS))


def at(mesh, x, y):
    """The cell whose lower corner is (x, y), as a mark."""
    return (mesh.points[mesh.cells[:, 0]] == (x, y)).all(axis=1)


def box(mesh, lower, upper):
    """Marks of the cells between two corners."""
    low = mesh.points[mesh.cells[:, 0]]
    return np.all((low >= lower) & (low + 1 <= upper), axis=1)


def test_a_cell_brings_its_vertices_and_the_cells_around(mesh):
    patches = Patches(mesh, np.zeros(15, bool))
    assert not patches.enriched.any() and not patches.chosen.any()
    assert patches.add(at(mesh, 1, 1)) == 4 and patches.refused == 0
    inside = np.all((mesh.points >= (1, 1)) & (mesh.points <= (2, 2)), axis=1)
    assert np.array_equal(patches.chosen, inside)
    assert np.array_equal(patches.enriched, box(mesh, (0, 0), (3, 3))) and np.array_equal(patches.whole, at(mesh, 1, 1))
    assert patches.add(at(mesh, 1, 1)) == 0, "nothing is new"
    assert patches.add(at(mesh, 2, 1)) == 2 and patches.enriched.sum() == 12 and patches.whole.sum() == 2


def test_neighbourhoods(mesh):
    patches = Patches(mesh, np.zeros(15, bool))
    cells = at(mesh, 0, 0)
    assert np.array_equal(np.flatnonzero(patches.touched(cells)), np.sort(mesh.cells[0]))
    assert np.array_equal(patches.around(cells), box(mesh, (0, 0), (2, 2)))


def test_vertices_of_barred_cells_never_join(mesh):
    """The column x > 4 is barred: its vertices stay out, so that no cell of it is enriched whole, and cells that wanted them are counted."""
    patches = Patches(mesh, box(mesh, (4, 0), (5, 3)))
    assert patches.add(at(mesh, 3, 1)) == 2 and patches.refused == 2
    assert not patches.chosen[mesh.points[:, 0] >= 4].any() and not patches.enriched[patches.barred].any() and not patches.whole.any()
    assert patches.add(np.ones(15, bool)) == 4 * 4 - 2 and patches.refused == 8
    assert np.array_equal(patches.whole, box(mesh, (0, 0), (3, 3))) and np.array_equal(patches.enriched, ~patches.barred)


def test_stored_patches_come_back(mesh):
    first, other = (Patches(mesh, np.zeros(15, bool)) for _ in range(2))
    first.add(at(mesh, 1, 1) | at(mesh, 4, 2))
    other.add(at(mesh, 0, 2))
    other.restore(first.chosen[: mesh.n_owned])
    for name in ("chosen", "enriched", "whole"):
        assert np.array_equal(getattr(other, name), getattr(first, name))


def test_principal_strains_are_eigenvalues(mesh):
    corner = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]])
    gradient = ELEMENTS["quad"].gradient(corner)
    displacement = np.random.default_rng(2).uniform(-1, 1, mesh.points.shape)
    chosen = np.array([7, 2, 11], np.int32)
    result = np.empty(3)
    largest_principal_strains(mesh.cells, chosen, gradient, displacement, result)
    slopes = np.einsum("pad,cae->cped", gradient, displacement[mesh.cells[chosen]])  # of component e along d
    expected = np.linalg.eigvalsh(0.5 * (slopes + slopes.transpose(0, 1, 3, 2)))[..., -1].max(axis=1)
    assert result == pytest.approx(expected, rel=1e-12)
    largest_principal_strains(mesh.cells, chosen, gradient, mesh.points @ np.array([[-2e-3, 1e-3], [-1e-3, -3e-3]]), result)
    assert result == pytest.approx(-2e-3), "rotation strains nothing, and the largest may be negative"
