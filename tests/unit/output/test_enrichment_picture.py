import numpy as np

from pdhpc.output import enrichment_picture
from pdhpc.output.enrichment_file import write_enrichment
from pdhpc.output.enrichment_picture import draw_enrichment
from tests.unit.output.test_picture import run_folder

VERTICES = {
    "vertices/id": np.arange(4),
    "vertices/position": np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]),
    "vertices/displacement": np.zeros((4, 2)),
    "vertices/patch": np.array([1, 1, 0, 0], np.int8),
    "vertices/enriched": np.array([[1, 1], [0, 1], [0, 0], [0, 0]], np.int8),
    "cells/vertex": np.array([[0, 2, 3, 1]]),
    "cells/patch": np.array([1], np.int8),
    "raster/position": np.array([[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]]),
    "raster/displacement": np.array([[1e-3, -1e-3], [2e-3, np.nan], [3e-3, -3e-3], [4e-3, -4e-3]]),
}
ATTRIBUTES = {"scheme": "galerkin", "time": 1.0, "step": 3, "spacing": 0.5, "pixel": 0.5}
FUNCTIONS = {
    "raster/functions": np.array([[1e-3], [2e-3], [0.0], [0.0]]),
    "functions/vertex": np.array([1]), "functions/component": np.array([1]),
    "unknowns/number": np.array([5, 3]), "unknowns/component": np.zeros(2, int), "unknowns/enriched": np.array([0, 1]), "unknowns/vertex": np.array([1, 1]),
    "entries/row": np.array([5, 5, 3]), "entries/column": np.array([5, 3, 5]),
}


def panels_of(monkeypatch, folder):
    """Return {title: axes} of the picture of a folder."""
    seen = []
    monkeypatch.setattr(enrichment_picture, "save", lambda figure, path: seen.append(figure) or path)
    assert draw_enrichment(folder) == folder / "enrichment.png"
    return {axes.get_title(): axes for axes in seen[0].axes if axes.get_title()}


def test_nothing_to_draw(tmp_path):
    assert draw_enrichment(tmp_path) is None


def test_the_picture_is_whole(comm, tmp_path):
    write_enrichment(comm, tmp_path, {**VERTICES, **FUNCTIONS}, {**ATTRIBUTES, "tolerance": 0.05})
    assert draw_enrichment(tmp_path).stat().st_size > 5000 and not list(tmp_path.glob("*.part*"))


def test_a_scheme_without_functions_of_its_own(comm, tmp_path, monkeypatch):
    write_enrichment(comm, tmp_path, VERTICES, ATTRIBUTES)
    panels = panels_of(monkeypatch, tmp_path)
    assert list(panels) == ["$u_x$ rebuilt from particles", "$u_y$ rebuilt from particles", r"enriched: 1 in x ($\times$), 2 in y ($\circ$) of 4 vertices"]
    field = panels["$u_x$ rebuilt from particles"]
    assert field.images[0].get_array().tolist() == [[1.0, 3.0], [2.0, 4.0]] and field.images[0].get_clim() == (-4.0, 4.0)  # mm; rows from below
    assert field.child_axes[0].get_ylabel() == "[mm]" and field.get_xlabel() == "x [m]"
    assert np.ma.is_masked(panels["$u_y$ rebuilt from particles"].images[0].get_array())


def test_functions_and_mass_matrix(comm, tmp_path, monkeypatch):
    """The unknown numbered 5 is the standard one and comes first, 3 the enriched one."""
    write_enrichment(comm, tmp_path, {**VERTICES, **FUNCTIONS}, ATTRIBUTES)
    panels = panels_of(monkeypatch, tmp_path)
    assert r"$\varphi_i\,u_y$,  $i$ at (0, 1) m" in panels
    entries = panels["mass matrix: 1 + 1 unknowns"].collections[0].get_paths()
    assert [path.vertices[:4].mean(axis=0).round(9).tolist() for path in entries] == [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]  # column, row


def test_particles_where_they_are(comm, tmp_path, monkeypatch):
    """Those of run_folder: the largest displacement, 0.0195 mm, is drawn 50 times, as 5 % of the body."""
    run_folder(tmp_path, comm, 2)
    data = {**VERTICES, "vertices/position": VERTICES["vertices/position"] * [0.02, 0.008], "raster/position": VERTICES["raster/position"] * [0.02, 0.008]}
    write_enrichment(comm, tmp_path, data, {**ATTRIBUTES, "spacing": 1e-3, "pixel": 1e-3})
    panels = panels_of(monkeypatch, tmp_path)
    assert {"particles, displacements x 50", "displacement $|u|$"} <= set(panels)
    assert len(panels["particles, displacements x 50"].collections[0].get_paths()) == 160
