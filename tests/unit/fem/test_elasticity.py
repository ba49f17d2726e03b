import numpy as np
import pytest

from pdhpc.fem.elasticity import CellMatrices, Elasticity
from pdhpc.fem.moduli import isotropic
from pdhpc.fem.nodes import stars_of
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, solid

SOFT, HARD = isotropic(1.0, 0.3, "plane_stress"), isotropic(5.0, 0.2, "plane_stress")


def test_equal_cells_of_a_box_share_one_matrix(comm):
    mesh = box_mesh(comm, (4, 3))
    kind = (mesh.cell_id % 2).astype(np.int32)
    body = Elasticity(mesh, [SOFT, HARD], [1.0, 2.0], kind)
    shared = body.stiffness()
    assert shared.table.shape == (2, 8, 8) and np.array_equal(shared.index, kind)
    mesh.cell_size = None  # the same cells, none known to be equal
    single = Elasticity(mesh, [SOFT, HARD], [1.0, 2.0], kind).stiffness()
    assert single.table.shape == (12, 8, 8) and np.allclose(single.matrices, shared.matrices[shared.index], atol=1e-14)


def test_thickness_scales_plane_bodies(comm):
    mesh = box_mesh(comm, (2, 2))
    thin, thick = (Elasticity(mesh, SOFT, 3.0, thickness=t) for t in (1.0, 0.25))
    assert np.allclose(thick.stiffness().table, 0.25 * thin.stiffness().table, rtol=1e-14)
    assert thick.lumped_mass(stars_of(mesh)).sum() == pytest.approx(3.0 * 0.25 * 1.2)


@pytest.mark.parametrize("kind, counts", (("quad", (3, 4)), ("tetra", (2, 2, 1))))
def test_masses_add_up(comm, kind, counts):
    mesh = general_mesh(comm, kind, counts, 0.2)
    body, dim = solid(mesh), mesh.dim
    mass = body.mass()
    whole = mass.matrices.reshape(len(mass.table), -1, dim, mesh.cells.shape[1], dim)
    assert whole[:, :, 0, :, 0].sum() == pytest.approx(np.prod([1.0, 1.2, 0.8][:dim])) and not whole[:, :, 0, :, 1].any()
    assert body.lumped_mass(stars_of(mesh)).sum() == pytest.approx(whole[:, :, 0, :, 0].sum())


def test_rows_are_padded_with_zeros():
    padded = CellMatrices.of(np.ones((2, 6, 6)), [0, 1])
    assert padded.table.shape == (2, 6, 8) and not padded.table[:, :, 6:].any() and np.array_equal(padded.matrices, np.ones((2, 6, 6)))


def test_what_makes_no_sense_is_refused(comm):
    mesh = box_mesh(comm, (2, 2))
    with pytest.raises(ValueError, match="densities"):
        Elasticity(mesh, SOFT, 0.0)
    with pytest.raises(ValueError, match="thickness -1.0 m"):
        Elasticity(mesh, SOFT, 1.0, thickness=-1.0)
    with pytest.raises(ValueError, match="numbers from 0 to 0"):
        Elasticity(mesh, SOFT, 1.0, np.ones(4, int))
    mesh = general_mesh(comm, "quad", (2, 2))
    mesh.points[np.abs(mesh.points - [0.5, 0.6]).sum(axis=1) < 1e-9] = [2.0, 2.0]
    with pytest.raises(ValueError, match="turned inside out"):
        solid(mesh).stiffness()
