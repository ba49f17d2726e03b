import numpy as np
import pytest

from pdhpc.fem.elasticity import Elasticity
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.mesh import cell_partition, make_box_mesh
from pdhpc.fem.moduli import isotropic
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.view import MeshView


def view_of(comm, counts, basis=None, thickness=1.0):
    """Return (MeshView, Elasticity, Nodes) of a box of cells of side 1/2."""
    upper = 0.5 * np.array(counts)
    partition = cell_partition(comm, 0 * upper, upper, counts)
    mesh = make_box_mesh(comm, 0 * upper, upper, counts, partition)
    dimension = {2: "plane_stress", 3: "3d"}[mesh.dim]
    body = Elasticity(mesh, isotropic(2.0, 0.25, dimension), 3.0, thickness=thickness, basis=basis)
    nodes = Nodes(mesh) if basis is None else Nodes(mesh, False, body.width)
    return MeshView(body, nodes, lambda: nodes.owned(nodes.force)), body, nodes


@pytest.mark.parametrize("counts", [(4, 3), (3, 2, 4)])
def test_a_uniform_strain_is_seen_at_every_vertex(comm, counts):
    view, body, nodes = view_of(comm, counts, thickness=0.1)
    dim, gradient = len(counts), np.diag([1e-3, 2e-3, 3e-3][: len(counts)])
    nodes.put(nodes.displacement, view.places() @ gradient.T)
    view.prepare()
    assert view.n == np.prod(np.array(counts) + 1) and view.dim == dim and view.carrier == "vertex" and view.cells.corners.shape == (np.prod(counts), 2**dim)
    assert view.volume.sum() == pytest.approx(np.prod(0.5 * np.array(counts)) * (0.1 if dim == 2 else 1.0)) and not view.block.any()
    assert np.allclose(view.field("strain"), gradient, atol=1e-15) and np.array_equal(view.field("displacement"), view.places() @ gradient.T)
    trace = np.trace(gradient)
    lame, shear = (2.0 * 0.25 / (1 - 0.25**2), 0.8) if dim == 2 else (2.0 * 0.25 / (1.25 * 0.5), 0.8)
    stress = lame * trace * np.eye(dim) + 2 * shear * gradient
    assert np.allclose(view.field("stress"), stress, atol=1e-14) and np.allclose(view.field("strain_energy_density"), 0.5 * (stress * gradient).sum())
    assert not view.field("damage").any() and view.foremost(np.arange(3), np.arange(3.0), 0.1) == -1 and view.broken() == view.directed_bonds() == 0
    with pytest.raises(KeyError):
        view.field("temperature")


def test_slopes_of_a_flat_top_basis_are_its_strains(comm):
    view, body, nodes = view_of(comm, (3, 2), FlatTop("quad"))
    gradient = np.array([[1e-3, 4e-3], [0.0, -2e-3]])
    nodes.put(nodes.displacement, body.basis.linear(body.mesh, gradient, np.zeros(2))[: view.n])
    assert np.allclose(view.field("strain"), 0.5 * (gradient + gradient.T)) and np.allclose(view.field("displacement"), view.places() @ gradient.T)
    assert np.allclose(view.field("stress"), np.einsum("abcd,cd->ab", body.tensors[0], gradient))


def test_forces_over_volume_and_what_is_not_finite(comm):
    view, _, nodes = view_of(comm, (2, 2))
    nodes.put(nodes.force, np.ones((view.n, 2)))
    assert np.allclose(view.field("force_density") * view.volume[:, None], 1.0) and view.first_not_finite() is None
    values = np.zeros((view.n, 2))
    values[5, 1] = np.nan
    nodes.put(nodes.displacement, values)
    assert view.first_not_finite() == (5, (0.5, 1.0))
