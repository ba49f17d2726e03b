"""Cells as points, against closed forms of their areas, volumes and centroids."""
from pathlib import Path

import meshio
import numpy as np
import pytest

from pdhpc.fem.cell_points import CellFile
from pdhpc.fem.facets import DIM, UNIT_CORNERS
from pdhpc.fem.mesh_file import _MIRRORED, read_file

HERE = Path(__file__).parent
SIZE = {"triangle": 1 / 2, "quad": 1.0, "tetra": 1 / 6, "hexahedron": 1.0}
CENTRE = {"triangle": 1 / 3, "quad": 1 / 2, "tetra": 1 / 4, "hexahedron": 1 / 2}


def written(folder, points, blocks, name="mesh.vtk", **more):
    points = np.asarray(points, float)
    points = np.hstack([points, np.zeros((len(points), 3 - points.shape[1]))])
    meshio.Mesh(points, [(kind, np.asarray(cells)) for kind, cells in blocks], **more).write(folder / name)
    return folder / name


def all_of(file, names=()):
    return [np.concatenate(each) for each in zip(*file.pieces(list(names)))]


@pytest.mark.parametrize("kind", sorted(DIM))
def test_sheared_cells(kind, tmp_path):
    """x -> A x + b: the centroid moves along, the volume is multiplied by |det A|, whichever way round the corners are."""
    dim = DIM[kind]
    a, b = np.array([[2.0, 0.3, 0.1], [0.0, 1.5, -0.2], [0.4, 0.0, 0.5]])[:dim, :dim], np.array([5.0, -1.0, 2.0])[:dim]
    corners = UNIT_CORNERS[kind] @ a.T + b
    order = np.arange(len(corners))
    points, volume, _ = all_of(CellFile(written(tmp_path, np.vstack([corners, corners + 20]), [(kind, [order, len(order) + order[_MIRRORED[kind]]])])))
    centre = a @ np.full(dim, CENTRE[kind]) + b
    assert points == pytest.approx(np.array([centre, centre + 20]), rel=1e-14) and volume == pytest.approx(SIZE[kind] * abs(np.linalg.det(a)), rel=1e-14)


def test_a_trapezium_and_a_frustum(tmp_path):
    """Sides a = 2 below and b = 1 above, of height 1: area 3/2, centroid at (a + 2 b)/(3 (a + b)) = 4/9; and the same with squares of these sides."""
    quad = [[-1, 0], [1, 0], [0.5, 1], [-0.5, 1]]
    points, volume, _ = all_of(CellFile(written(tmp_path, quad, [("quad", [[0, 1, 2, 3]])])))
    assert volume == pytest.approx([1.5]) and points[0] == pytest.approx([0.0, 4 / 9])
    frustum = [[x * s, y * s, z] for z, s in ((0, 1), (1, 0.5)) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    points, volume, _ = all_of(CellFile(written(tmp_path, frustum, [("hexahedron", [range(8)])])))
    # area (2 - z)^2 at height z: V = int = 7/3, int z (2 - z)^2 = 11/12
    assert volume == pytest.approx([7 / 3]) and points[0] == pytest.approx([0.0, 0.0, (11 / 12) / (7 / 3)])


def test_triangles_beside_quads(tmp_path):
    file = CellFile(written(tmp_path, [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], [("triangle", [[1, 4, 2]]), ("quad", [[0, 1, 2, 3]]), ("line", [[0, 1]])]))
    points, volume, _ = all_of(file)
    assert file.dim == 2 and file.count == 2 and sorted(volume.tolist()) == pytest.approx([0.5, 1.0]) and points.shape == (2, 2)


@pytest.mark.parametrize("version", [2, 4])
def test_gmsh_groups(version):
    """A quarter of a plate with a hole of 1 m, four quads, two of them in "lower half"; "bottom" and "hole" are lines, of two facets each."""
    file = CellFile(HERE / f"quarter_plate_{version}.msh")
    assert file.repeated == 0 and file.cell_groups == ["lower half", "plate"] and set(file.groups) == {"lower half", "plate", "bottom", "right", "top", "left", "hole"}
    points, volume, marks = all_of(file, ["plate", "bottom", "right", "nothing", "lower half"])
    bits = [(marks >> np.uint64(k) & np.uint64(1)).astype(bool) for k in range(5)]
    assert len(points) == 4 and bits[0].all() and bits[1].sum() == 2 and bits[2].sum() == 1 and not bits[3].any()
    assert np.array_equal(bits[4], points[:, 1] < points[:, 0])
    # 3 m x 3 m without the octagon's quarter that two chords of 45 degrees make of the hole: 2 (1/2 sin 45)
    assert volume.sum() == pytest.approx(9 - np.sin(np.pi / 4))


def test_cells_that_stand_there_again_are_counted(tmp_path):
    """Once in another order of corners, once in another block; with a group of their own, as gmsh's format 2 has it, they are not."""
    points, cell = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]], [0, 1, 2, 3]
    path = written(tmp_path, points, [("quad", [cell, [1, 4, 5, 2], [2, 3, 0, 1]]), ("triangle", [[0, 1, 2]]), ("quad", [cell])])
    assert CellFile(path).repeated == 2 and CellFile(path).count == 3
    blocks = [("quad", np.array([cell])), ("quad", np.array([cell])), ("quad", np.array([cell]))]
    for tags, expected in (([1, 2, 3], 0), ([1, 2, 1], 1), ([1, 1, 1], 2)):
        file = tmp_path / "tagged.msh"
        data = {key: [np.array([tag]) for tag in tags] for key in ("gmsh:physical", "gmsh:geometrical")}
        meshio.write(file, meshio.Mesh(np.array([[*point, 0.0] for point in points]), blocks, cell_data=data), file_format="gmsh22", binary=False)
        assert CellFile(file).repeated == expected == read_file(file).repeated, tags


def test_point_sets_hold_the_cells_that_touch_them(tmp_path):
    squares = [[0, 0], [1, 0], [2, 0], [3, 0], [0, 1], [1, 1], [2, 1], [3, 1]]
    path = written(tmp_path, squares, [("quad", [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]])], "mesh.inp", point_sets={"pin": np.array([1])})
    _, _, marks = all_of(CellFile(path), ["pin"])
    assert marks.tolist() == [1, 1, 0] and CellFile(path).cell_groups == []


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


@pytest.mark.parametrize("points, blocks, words", [
    (SQUARE, [("line", [[0, 1]])], "has no cells"),
    (SQUARE, [("triangle6", [[0, 1, 2, 3, 0, 1]])], "cells of kind triangle6"),
    (SQUARE, [("quad", [[0, 1, 1, 0]])], "flat or folded"),
    (SQUARE, [("quad", [[0, 2, 1, 3]])], "flat or folded"),
    ([[0, 0], [1, 0], [1, np.nan], [0, 1]], [("quad", [[0, 1, 2, 3]])], "not finite"),
    ([[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]], [("quad", [[0, 1, 2, 3]])], "third coordinate"),
])
def test_broken_meshes(points, blocks, words, tmp_path):
    with pytest.raises(ValueError, match=words) as caught:
        CellFile(written(tmp_path, points, blocks))
    assert str(caught.value).startswith("the mesh ") and "mesh.vtk" in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_are_no_meshes(tmp_path):
    with pytest.raises(ValueError, match="there is no mesh"):
        CellFile(tmp_path / "none.msh")
    for name, text in (("junk.msh", "junk"), ("junk.inp", "*NODE\n1, a\n"), ("mesh.txt", "0 0"), ("mesh.vtk", "")):
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match="cannot be read|has no cells"):
            CellFile(tmp_path / name)


def test_a_file_larger_than_the_memory(tmp_path):
    """A file with a hole: its size is 2^42 bytes."""
    with open(tmp_path / "huge.msh", "wb") as file:
        file.truncate(1 << 42)
    with pytest.raises(ValueError, match="has 4.4e.03 GB, and rank 0, which reads it whole, needs about 4 times that"):
        CellFile(tmp_path / "huge.msh")
