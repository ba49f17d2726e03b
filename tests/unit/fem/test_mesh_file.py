from pathlib import Path

import meshio
import numpy as np
import pytest

from pdhpc.fem.facets import DIM, FACETS, UNIT_CORNERS
from pdhpc.fem.mesh_file import _MIRRORED, read_file

HERE = Path(__file__).parent
SQUARES = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [9, 9, 0]], float)  # the last point belongs to no cell
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])


def written(folder, points, blocks, name="mesh.vtk", **more):
    path = folder / name
    mesh = meshio.Mesh(np.asarray(points, float), [(kind, np.asarray(cells)) for kind, cells in blocks], **more)
    mesh.write(path, **({"file_format": "gmsh22", "binary": False} if name.endswith("msh") else {}))
    return path


def facets_of(mesh, name):
    """Return the file's point numbers of a set's facets."""
    cell, facet = mesh.sets[name]
    return mesh.vertex_id[mesh.cells[cell[:, None], FACETS[mesh.kind][facet]]].tolist()


@pytest.mark.parametrize("version", [2, 4])
def test_gmsh_groups_by_name(version):
    """A quarter of a plate, 3 m, with a hole of 1 m, four quads: two groups share its lower half, whose cells gmsh's format 2 lists twice."""
    mesh = read_file(HERE / f"quarter_plate_{version}.msh")
    assert mesh.kind == "quad" and mesh.cells.shape == (4, 4) and mesh.points.shape == (9, 2)
    centres = mesh.points[mesh.cells].mean(axis=1)
    assert mesh.regions["plate"].all() and np.array_equal(mesh.regions["lower half"], centres[:, 1] < centres[:, 0])
    assert {name: len(cell) for name, (cell, _) in mesh.sets.items()} == {"bottom": 2, "right": 1, "top": 1, "left": 2, "hole": 2}
    at = {name: mesh.points[np.searchsorted(mesh.vertex_id, facets_of(mesh, name))] for name in mesh.sets}
    assert np.all(at["bottom"][..., 1] == 0.0) and np.all(at["right"][..., 0] == 3.0) and np.all(at["top"][..., 1] == 3.0) and np.all(at["left"][..., 0] == 0.0)
    assert np.hypot(*at["hole"].T) == pytest.approx(1.0)
    edge = at["hole"][:, 1] - at["hole"][:, 0]
    normal = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    assert np.all((normal * at["hole"].mean(axis=1)).sum(axis=1) < 0.0), "out of the body is into the hole"


@pytest.mark.parametrize("kind", sorted(DIM))
def test_cells_of_the_other_orientation_are_turned_round(kind, tmp_path):
    corners = UNIT_CORNERS[kind].astype(float)
    points = np.hstack([corners, np.zeros((len(corners), 3 - DIM[kind]))])
    right = np.arange(len(corners))
    for cells in (right, right[_MIRRORED[kind]]):
        mesh = read_file(written(tmp_path, points, [(kind, [cells])]))
        assert mesh.cells.tolist() == [right.tolist()] and np.array_equal(mesh.points, corners)


def test_points_without_cells_do_not_exist_and_ids_stay_those_of_the_file(tmp_path):
    mesh = read_file(written(tmp_path, SQUARES[::-1], [("quad", 6 - QUADS)]))
    assert mesh.vertex_id.tolist() == [1, 2, 3, 4, 5, 6] and np.array_equal(mesh.points, SQUARES[5::-1, :2])
    assert mesh.vertex_id[mesh.cells].tolist() == (6 - QUADS).tolist()


def test_groups_without_names_and_facets_within_the_body(tmp_path):
    """Group 5 is the left cell, 8 the edge at x = 2 and the one between the cells, which is not on the surface; 0 stands for no group."""
    more = {"cell_data": {"gmsh:physical": [np.array([5, 0]), np.array([8, 8, 0])], "gmsh:geometrical": [np.ones(2, int), np.ones(3, int)]}}
    mesh = read_file(written(tmp_path, SQUARES, [("quad", QUADS), ("line", [[5, 2], [1, 4], [0, 1]])], "mesh.msh", **more))
    assert {name: marks.tolist() for name, marks in mesh.regions.items()} == {"5": [True, False]}
    assert list(mesh.sets) == ["8"] and facets_of(mesh, "8") == [[2, 5]]


def test_faces_of_tetrahedra_from_gmsh(tmp_path):
    """Two tetrahedra on the common face (1, 2, 3); a name belongs to a number and a dimension."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], float)
    tags = [np.array([1, 2]), np.array([1, 1])]
    names = {"base": np.array([1, 2]), "inner": np.array([1, 3]), "outer": np.array([2, 3])}
    blocks = [("tetra", [[0, 1, 2, 3], [1, 2, 3, 4]]), ("triangle", [[0, 1, 2], [2, 4, 3]])]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    mesh = read_file(written(tmp_path, points, blocks, "mesh.msh", cell_data=data, field_data=names))
    assert {name: marks.tolist() for name, marks in mesh.regions.items()} == {"inner": [True, False], "outer": [False, True]}
    assert sorted(map(sorted, facets_of(mesh, "base"))) == [[0, 1, 2], [2, 3, 4]]
    for facet in facets_of(mesh, "base"):
        p = points[facet]
        assert np.cross(p[1] - p[0], p[2] - p[0]) @ (p.mean(axis=0) - points.mean(axis=0)) > 0.0


def test_abaqus_sets_of_elements_and_nodes(tmp_path):
    path = tmp_path / "mesh.inp"
    lines = ["*NODE", *(f"{k + 1}, {p[0]}, {p[1]}, 0" for k, p in enumerate(SQUARES)), "*ELEMENT, TYPE=CPS4", "1, 1, 2, 5, 4", "2, 2, 3, 6, 5"]
    lines += ["*ELSET, ELSET=glass", "2,", "*NSET, NSET=lower", "1, 2, 3", "*NSET, NSET=corner", "1,"]
    path.write_text("\n".join(lines) + "\n")
    mesh = read_file(path)
    assert mesh.regions["glass"].tolist() == [False, True]
    assert facets_of(mesh, "lower") == [[0, 1], [1, 2]] and facets_of(mesh, "corner") == []


def test_two_groups_of_the_same_cells_are_one_mesh(tmp_path):
    path = written(tmp_path, SQUARES, [("quad", [*QUADS, [4, 3, 0, 1]])])
    assert read_file(path).cells.tolist() == QUADS.tolist()


def test_blocks_without_cells_do_not_count(tmp_path, monkeypatch):
    path = written(tmp_path, SQUARES, [("quad", QUADS)])
    monkeypatch.setattr(meshio, "read", lambda path: meshio.Mesh(SQUARES, [("line", []), ("quad", []), ("quad", QUADS)]))
    assert read_file(path).cells.tolist() == QUADS.tolist()


WRONG = {
    "no cells": ([("line", [[0, 1]])], "has no cells"),
    "several kinds": ([("quad", [QUADS[0]]), ("triangle", [[1, 2, 5]])], "several kinds, quad and triangle"),
    "quadratic": ([("triangle6", [[0, 2, 5, 1, 4, 3]])], "cells of kind triangle6; a mesh has cells of one of the kinds hexahedron, quad, tetra, triangle"),
    "flat": ([("triangle", [[0, 1, 2]])], r"1 flat or folded cells, the first of them around \(1, 0\) m"),
    "corner twice": ([("quad", [QUADS[0], [1, 2, 2, 4]])], "1 flat or folded cells"),
    "folded": ([("quad", [[0, 1, 3, 4]])], "1 flat or folded cells"),
}


@pytest.mark.parametrize("case", sorted(WRONG))
def test_a_mesh_that_cannot_be_used_is_refused(case, tmp_path):
    blocks, message = WRONG[case]
    with pytest.raises(ValueError, match=f"the mesh .*mesh.vtk .*{message}"):
        read_file(written(tmp_path, SQUARES, blocks))


def test_coordinates_that_make_no_mesh_are_refused(tmp_path):
    tilted, lost = SQUARES.copy(), SQUARES.copy()
    tilted[:, 2] = 0.1 * tilted[:, 0]
    lost[2, 1] = np.nan
    with pytest.raises(ValueError, match="third coordinate is not the same everywhere, but spans 0.2 m"):
        read_file(written(tmp_path, tilted, [("quad", QUADS)]))
    with pytest.raises(ValueError, match="1 points with coordinates that are not finite"):
        read_file(written(tmp_path, lost, [("quad", QUADS)]))
    lifted = SQUARES + [0.0, 0.0, 5.0]
    assert read_file(written(tmp_path, lifted, [("quad", QUADS)])).points.shape == (6, 2)


@pytest.mark.parametrize("name, text, message", [
    ("mesh.msh", b"nothing of the kind\n", ""),
    ("mesh.msh", b"", ""),
    ("mesh.msh", b"$MeshFormat\n" + 99 * b"\x80", ""),
    ("mesh.msh", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + 200 * b"x", r" \(meshio says: .{120}\.\.\.\)"),
    ("mesh.txt", b"0 0 0\n", r" \(meshio says: [Cc]ould not deduce .*\)"),
    ("mesh.inp", b"*NODE\n1, 0, 0\n*ELEMENT, TYPE=CPE4\n1, 1, 1, 1, 1\n", r" \(meshio says: .*CPE4\)"),
    ("mesh.vtk", b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n0 0 0\n", ""),
])
def test_a_file_that_is_no_mesh_is_refused(name, text, message, tmp_path, capsys):
    """In one sentence, with meshio's words where it has some, and with none of numpy's."""
    (tmp_path / name).write_bytes(text)
    with pytest.raises(ValueError, match=f"^the mesh .*{name} cannot be read: it is cut short, damaged, or of another kind than its name says{message}$"):
        read_file(tmp_path / name)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("version", [2, 4])
def test_a_file_that_is_cut_short_is_refused(version, tmp_path, recwarn):
    """Wherever: what is left of gmsh's files is no mesh, has no cells, or some that lack a corner or stand on a wrong point."""
    text = (HERE / f"quarter_plate_{version}.msh").read_bytes()
    for length in range(0, len(text.partition(b"$EndElements")[0].rstrip()), 3):
        (tmp_path / "cut.msh").write_bytes(text[:length])
        with pytest.raises(ValueError, match=r"cut.msh (has [^\n]*|cannot be read: it is cut short, damaged, or of another kind than its name says( \(meshio says: [^\n]*\))?)$"):
            read_file(tmp_path / "cut.msh")
    assert not recwarn.list


@pytest.mark.parametrize("failure, message", [
    (ModuleNotFoundError("No module named 'netCDF4'", name="netCDF4"), "that takes the package netCDF4, which is not installed"),
    (PermissionError(13, "Permission denied"), "Permission denied"),
])
def test_what_a_file_is_not_to_blame_for(failure, message, tmp_path, monkeypatch):
    def read(path):
        raise failure

    monkeypatch.setattr(meshio, "read", read)
    with pytest.raises(ValueError, match=f"mesh.vtk cannot be read: {message}$"):
        read_file(written(tmp_path, SQUARES, [("quad", QUADS)]))


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ValueError, match="there is no mesh .*none.msh"):
        read_file(tmp_path / "none.msh")
    with pytest.raises(ValueError, match="there is no mesh"):
        read_file(tmp_path)


def test_cells_with_points_that_the_file_lacks_are_refused(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n")
    for wrong in (path, *(written(tmp_path, SQUARES, [("quad", QUADS), ("line", [facet])], f"{facet[0]}.vtk") for facet in ([0, 9], [-1, 0]))):
        with pytest.raises(ValueError, match="points that it does not hold"):
            read_file(wrong)
