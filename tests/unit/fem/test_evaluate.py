import numpy as np
import pytest

from pdhpc.fem.evaluate import cell_stresses, errors, fields_in_cells, nodal_stresses, stresses_in_cells
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.moduli import isotropic
from pdhpc.fem.nodes import stars_of
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, linear_field, solid


@pytest.mark.parametrize("kind, counts", (("triangle", (3, 2)), ("hexahedron", (2, 2, 2))))
def test_uniform_strain_has_its_stress_everywhere(comm, kind, counts):
    mesh = general_mesh(comm, kind, counts, 0.2)
    body, exact = solid(mesh), linear_field(len(counts))
    u, gradient = exact.displacement(mesh.points), exact.gradient(np.zeros((1, 2)))[0]
    strain = 0.5 * (gradient + gradient.T)
    voigt = [strain[0, 0], strain[1, 1], 2 * strain[0, 1]] if mesh.dim == 2 else [*np.diag(strain), 2 * strain[1, 2], 2 * strain[0, 2], 2 * strain[0, 1]]
    stress = isotropic(1.0, 0.3, "3d" if mesh.dim == 3 else "plane_stress") @ voigt
    assert np.allclose(cell_stresses(body, u), stress) and np.allclose(nodal_stresses(body, stars_of(mesh), u), stress)
    xi = np.full((2, mesh.dim), 0.25)
    values, gradients = fields_in_cells(body, u, xi)
    places = np.einsum("qc,fcx->fqx", body.basis.element.shape(xi), mesh.points[mesh.cells])
    assert np.allclose(values, places @ gradient.T + [0.1, -0.2, 0.3][: mesh.dim]) and np.allclose(gradients, gradient)
    assert np.allclose(stresses_in_cells(body, u, xi, slice(0, 2)), stress)
    assert max(errors(body, u, exact.displacement, exact.gradient)) < 1e-14


def test_nodal_stress_is_the_mean_of_the_cells_around(comm):
    """Two cells of stresses 1 and 3 and equal sizes: 2 at the vertices between."""
    mesh = box_mesh(comm, (2, 1), (2.0, 1.0))
    u = np.stack([np.where(mesh.points[:, 0] < 1.5, mesh.points[:, 0], 4.0), 0 * mesh.points[:, 0]], axis=1)
    body = solid(mesh, 0.0)
    assert nodal_stresses(body, stars_of(mesh), u)[:, 0] == pytest.approx([1, 1, 2, 2, 3, 3])


@pytest.mark.parametrize("basis", (None, FlatTop("quad")))
def test_errors_are_norms(comm, basis):
    """u = 0 against u = (x, 0) on the unit square: sqrt(1/3) and 1."""
    mesh = box_mesh(comm, (3, 3), (1.0, 1.0))
    body = solid(mesh, basis=basis)
    gradient = np.array([[1.0, 0], [0, 0]])
    found = errors(body, np.zeros((16, body.width)), lambda x: x * [1, 0], lambda x: np.tile(gradient, (len(x), 1, 1)))
    assert found == pytest.approx((np.sqrt(1 / 3), 1.0))
