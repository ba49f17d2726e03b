import numpy as np
import pytest

from pdhpc.fem.elements import ELEMENTS
from pdhpc.kernels.recovery import recover_strain, recover_stress

GRADIENT = np.array([[2e-3, -1e-3], [5e-3, 4e-3]])


def two_cells(kind):
    """Return (points, cells, stars) of two skewed cells with a common side."""
    points = np.array([[0.0, 0.0], [1.0, 0.1], [2.2, 0.0], [0.1, 1.0], [1.2, 1.3], [2.0, 0.9]])
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]] if kind == "quad" else [[0, 1, 3], [1, 4, 3]], np.int32)
    around = [np.argwhere(cells == vertex) for vertex in range(len(points))]
    start = np.concatenate(([0], np.cumsum([len(each) for each in around])))
    found = np.concatenate(around)
    return points, cells, (start, found[:, 0].astype(np.int32), found[:, 1].astype(np.int8))


@pytest.mark.parametrize("kind", ("quad", "triangle"))
def test_linear_displacements_are_exact(kind):
    points, cells, stars = two_cells(kind)
    at = ELEMENTS[kind].gradient(ELEMENTS[kind].places)
    u = points @ GRADIENT.T
    strain, stress = np.empty((6, 2, 2)), np.empty((6, 2, 2))
    recover_strain(points, cells, at, u, stars, strain)
    used = np.isin(np.arange(6), cells)
    expected = 0.5 * (GRADIENT + GRADIENT.T)
    assert np.allclose(strain[used], expected, atol=1e-15) and not strain[~used].any()
    delta = np.eye(2)
    tensors = 3.0 * np.einsum("ab,cd->abcd", delta, delta)[None] + 2.0 * (np.einsum("ac,bd->abcd", delta, delta) + np.einsum("ad,bc->abcd", delta, delta))
    recover_stress(points, cells, at, u, stars, tensors, np.zeros(2, np.int32), stress)
    assert np.allclose(stress[used], 3.0 * np.trace(expected) * delta + 4.0 * expected, atol=1e-14)


def test_each_cell_counts_with_its_size_and_its_own_moduli():
    """Two unit quads, the second twice as long, with moduli 1 and 4 for u_x = x: at the common vertices (1 + 2 * 4) / 3."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [0.0, 1.0], [1.0, 1.0], [3.0, 1.0]])
    _, cells, stars = two_cells("quad")
    tensors = np.zeros((2, 2, 2, 2, 2))
    tensors[0, 0, 0, 0, 0], tensors[1, 0, 0, 0, 0] = 1.0, 4.0
    stress = np.empty((6, 2, 2))
    recover_stress(points, cells, ELEMENTS["quad"].gradient(ELEMENTS["quad"].places), points * [1.0, 0.0], stars, tensors, np.array([0, 1], np.int32), stress)
    assert np.allclose(stress[:, 0, 0], [1.0, 3.0, 4.0, 1.0, 3.0, 4.0])
