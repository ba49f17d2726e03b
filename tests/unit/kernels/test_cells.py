import numpy as np
import pytest

from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.moduli import PAIRS, isotropic
from pdhpc.kernels import cells as loops

UNIT = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])


def tensor_of(c, dim):
    place = np.empty((dim, dim), int)
    for number, (a, b) in enumerate(PAIRS[dim]):
        place[a, b] = place[b, a] = number
    return c[place[:, :, None, None], place[None, None]][None]


def matrices(kind, points, dimension):
    """Stiffness of one cell by the kernel."""
    element = ELEMENTS[kind]
    xi, weights = element.gauss
    n = element.corners * element.dim
    table = np.empty((1, n, n))
    cells = np.arange(element.corners, dtype=np.int32)[None]
    gradient = element.gradient(xi)
    loops.stiffnesses(points, cells, gradient, gradient, weights, tensor_of(isotropic(1.0, 0.3, dimension), element.dim), np.zeros(1, np.int32), table)
    return table[0]


def by_b_matrix(kind, points, dimension):
    """The textbook's sum of w det B^T C B, point by point."""
    element = ELEMENTS[kind]
    result = 0.0
    for xi, weight in zip(*element.gauss):
        jacobian = points.T @ element.gradient(xi)[0]
        gradient = element.gradient(xi)[0] @ np.linalg.inv(jacobian)
        b = np.zeros((len(PAIRS[element.dim]), element.corners, element.dim))
        for row, (first, second) in enumerate(PAIRS[element.dim]):
            b[row, :, first] += gradient[:, second]
            if first != second:
                b[row, :, second] += gradient[:, first]
        b = b.reshape(len(b), -1)
        result = result + weight * np.linalg.det(jacobian) * b.T @ isotropic(1.0, 0.3, dimension) @ b
    return result


@pytest.mark.parametrize("kind, dimension", (("quad", "plane_stress"), ("triangle", "plane_strain"), ("hexahedron", "3d"), ("tetra", "3d")))
def test_stiffness_is_the_textbooks(kind, dimension):
    element = ELEMENTS[kind]
    points = element.places + 0.1 * np.random.default_rng(0).standard_normal(element.places.shape)
    found = matrices(kind, points, dimension)
    assert found == pytest.approx(by_b_matrix(kind, points, dimension), abs=1e-14)
    eigenvalues = np.linalg.eigvalsh(found)
    rigid = 3 if element.dim == 2 else 6
    assert np.abs(eigenvalues[:rigid]).max() < 1e-13 and eigenvalues[rigid] > 1e-3  # rigid motions cost nothing, all else does


def test_mass_of_a_unit_square():
    """4/36 on the diagonal, 2/36 along sides, 1/36 across."""
    element = ELEMENTS["quad"]
    xi, weights = element.gauss
    table = np.empty((1, 4, 4))
    cells = np.arange(4, dtype=np.int32)[None]
    loops.masses(UNIT, cells, element.gradient(xi), element.shape(xi), weights, np.array([36.0]), np.zeros(1, np.int32), table)
    assert table[0] == pytest.approx(np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4.0]]))


def test_a_cell_inside_out_is_found():
    element = ELEMENTS["quad"]
    xi, weights = element.gauss
    measures = np.tile(weights, (2, 1))
    cells = np.array([[0, 1, 2, 3], [0, 3, 2, 1]], np.int32)
    assert loops.measure(UNIT, cells, element.gradient(xi), measures) == 1
    assert measures.sum(axis=1) == pytest.approx([1.0, -1.0])


def test_forces_are_products_and_vertices_gather_in_the_order_listed():
    rng = np.random.default_rng(1)
    for width, corners in ((2, 3), (2, 4), (3, 4), (3, 8), (1, 3)):
        n = width * corners
        table = np.zeros((2, n, -(-n // 8) * 8))
        table[:, :, :n] = rng.standard_normal((2, n, n))
        table[:, :, :n] += table[:, :, :n].transpose(0, 2, 1).copy()
        cells = np.stack([rng.permutation(12)[:corners] for _ in range(5)]).astype(np.int32)
        index, slots = np.array([0, 1, 1, 0, 1], np.int32), rng.permutation(16)[:12].astype(np.int32)
        field, forces = rng.standard_normal((width, 16)).T, np.zeros((5, table.shape[2]))
        loops.cell_forces(cells, slots, index, table, field, np.array([0, 1, 3, 4], np.int32), forces)
        local = field[slots[cells]].reshape(5, n)
        expected = np.einsum("cij,cj->ci", table[index][:, :, :n], local)
        expected[2] = 0.0
        assert np.allclose(forces[:, :n], expected, atol=1e-12)
        energy = np.empty(5)
        loops.cell_energies(cells, slots, field, forces, energy)
        assert energy == pytest.approx(0.5 * (expected * local).sum(axis=1), abs=1e-12)
        start, size = np.zeros(8, np.int64), int((cells < 7).sum())
        cell, corner = np.empty(size, np.int32), np.empty(size, np.int8)
        order = np.array([4, 2, 0, 1, 3])
        loops.stars(cells, order, 7, start, cell, corner)
        result, dense = np.zeros((width, 16)).T, np.zeros((16, width))
        loops.gather(start, cell, corner, forces, slots, -1.0, result)
        np.add.at(dense, slots[cells], -expected.reshape(5, corners, width))
        assert np.allclose(result[slots[:7]], dense[slots[:7]], atol=1e-12)
        for v in range(7):
            around = cell[start[v] : start[v + 1]]
            assert around.tolist() == [c for c in order if v in cells[c]] and all(cells[c, k] == v for c, k in zip(around, corner[start[v] : start[v + 1]]))
