import numpy as np
import pytest

from pdhpc.output.fields import Cells, FieldWriter
from pdhpc.output.mesh_picture import _largest_principal, _Mesh, draw_mesh
from pdhpc.output.picture import draw


def box(folder, comm, kind, stress=True):
    """Write a run on 4 x 2 quads, 8 x 2 triangles, or 2 x 2 x 2 hexahedra."""
    counts = (4, 2) if kind != "hexahedron" else (2, 2, 2)
    number = np.arange(np.prod(np.array(counts) + 1)).reshape(np.array(counts) + 1)
    x = np.stack(np.meshgrid(*[np.arange(n + 1.0) for n in counts], indexing="ij"), axis=-1).reshape(-1, len(counts))
    plane = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    if kind == "hexahedron":
        cells = np.stack([each[..., k : each.shape[2] - 1 + k].ravel() for k in (0, 1) for each in plane], axis=1)
    else:
        cells = np.stack([each.ravel() for each in plane], axis=1)
    if kind == "triangle":
        cells = np.concatenate([cells[:, :3], cells[:, [0, 2, 3]]])
    writer = FieldWriter(comm, folder, {})
    writer.write_points(np.arange(len(x)), x, np.ones(len(x)), np.zeros(len(x)), Cells(kind, cells))
    tensor = np.einsum("n,ab->nab", x[:, 0], np.eye(len(counts)))
    writer.write_frame(1, 0.1, {"displacement": 1e-3 * x, **({"stress": tensor} if stress else {})})
    return x


@pytest.mark.parametrize("kind", ("quad", "triangle", "hexahedron"))
def test_pictures_of_a_mesh(tmp_path, comm, kind):
    box(tmp_path, comm, kind)
    drawn = draw(tmp_path)
    assert {path.name for path in drawn} == {"displacement.png", "stress.png", "deformed.png"}
    assert all(path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 3000 for path in drawn) and not list(tmp_path.glob("*.part*"))


def test_only_what_there_is_data_for(tmp_path, comm):
    box(tmp_path, comm, "quad", stress=False)
    assert [path.name for path in draw_mesh(tmp_path)] == ["displacement.png", "deformed.png"]


def test_the_surface_of_a_cube_is_its_outer_facets(tmp_path, comm):
    x = box(tmp_path, comm, "hexahedron")
    facets = _Mesh(tmp_path).facets
    assert len(facets) == 24 and 13 not in facets and np.allclose(x[13], 1.0), "all vertices but the one in the middle"


def test_largest_principal_stress():
    stress = np.zeros((3, 9))
    stress[0, 1] = stress[0, 3] = 2.0  # pure shear
    stress[1, [0, 4]] = -1.0, -3.0
    stress[2, 0] = np.nan
    assert np.allclose(_largest_principal(stress, 2), [2.0, -1.0, np.nan], equal_nan=True)
    assert np.allclose(_largest_principal(stress, 3), [2.0, 0.0, np.nan], equal_nan=True)
