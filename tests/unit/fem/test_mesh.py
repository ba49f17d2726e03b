from pathlib import Path

import numpy as np
import pytest

from pdhpc.fem.mesh import cell_partition, make_box_mesh, read_mesh


def box(comm, counts, keep=None):
    dim = len(counts)
    return make_box_mesh(comm, [0.0] * dim, [float(n) for n in counts], counts, cell_partition(comm, [0.0] * dim, [1.0] * dim, counts, None), keep)


def test_unit_cells_of_a_box(comm):
    mesh = box(comm, (2, 3, 4))
    assert (mesh.dim, mesh.kind, mesh.n_owned_cells, mesh.n_owned, mesh.n_global_cells, mesh.n_global_vertices) == (3, "hexahedron", 24, 60, 24, 60)
    assert np.array_equal(mesh.points[mesh.cells[:, 0]], mesh.index) and mesh.cell_size.tolist() == [1.0, 1.0, 1.0]
    assert np.array_equal(mesh.cell_id, np.arange(24)) and len(mesh.cell_owner) == 0 and mesh.exchange.sent == 0


@pytest.mark.parametrize("counts", [(4, 3), (2, 3, 4)], ids=["quads", "hexahedra"])
def test_boundary_closes_the_body(counts, comm):
    """The outward normals add up to nothing and by Gauss' theorem sum(normal . centre) = dim times the volume."""
    mesh = box(comm, counts)
    facets, cell = mesh.boundary()
    assert len(facets) == sum(2 * np.prod(counts) // n for n in counts) and np.all(np.diff(cell) >= 0)
    p = mesh.points[facets]
    if mesh.dim == 2:
        normal = np.stack([p[:, 1, 1] - p[:, 0, 1], p[:, 0, 0] - p[:, 1, 0]], axis=1)
    else:
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 3] - p[:, 0])
    assert np.all(normal.sum(axis=0) == 0.0) and (normal * p.mean(axis=1)).sum() == pytest.approx(mesh.dim * np.prod(counts))


def test_a_hole_has_a_boundary_and_no_vertices_inside(comm):
    """Of 5 x 5 cells the inner 3 x 3 are left out: 20 + 12 edges, and the 2 x 2 vertices within the hole do not exist."""
    mesh = box(comm, (5, 5), lambda centres: np.abs(centres - 2.5).max(axis=1) > 1.6)
    assert (mesh.n_global_cells, mesh.n_global_vertices, len(mesh.boundary()[1])) == (16, 32, 32)
    assert mesh.cell_id.max() == 24 and mesh.vertex_id.max() == 35


def test_stars_hold_each_corner_once(comm):
    start, star = box(comm, (3, 2)).stars()
    assert np.diff(start).sum() == 24 and np.diff(start).max() == 4 and start[-1] == len(star)


def test_a_mesh_without_cells_is_refused(comm):
    with pytest.raises(ValueError, match="no cell"):
        box(comm, (3, 2), lambda centres: centres[:, 0] > 100.0)


def test_a_file_becomes_a_mesh(comm):
    mesh = read_mesh(comm, Path(__file__).parent / "quarter_plate_4.msh")
    assert (mesh.kind, mesh.n_owned_cells, mesh.n_global_vertices, mesh.cell_size, mesh.index) == ("quad", 4, 9, None, None)
    assert mesh.regions["plate"].all() and np.all(mesh.points[mesh.sets["top"]][..., 1] == 3.0) and len(mesh.boundary()[1]) == 8
