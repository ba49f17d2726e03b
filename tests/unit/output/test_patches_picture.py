import numpy as np

from pdhpc.output import patches_picture
from pdhpc.output.enrichment_file import write_enrichment
from pdhpc.output.patches_picture import corners_of, draw_patches
from tests.unit.output.test_enrichment_picture import ATTRIBUTES, VERTICES
from tests.unit.output.test_picture import run_folder


def test_nothing_to_draw(tmp_path, comm):
    """A run of particles alone; a coupled one without fields."""
    run_folder(tmp_path, comm, 2)
    assert draw_patches(tmp_path) is None
    write_enrichment(comm, tmp_path / "fields", VERTICES, ATTRIBUTES)
    assert draw_patches(tmp_path / "fields") is None


def test_cells_find_their_corners_whatever_the_order_of_vertices():
    order = np.array([3, 0, 2, 1])
    shuffled = {**VERTICES, **{name: VERTICES[name][order] for name in ("vertices/id", "vertices/position")}}
    assert corners_of(shuffled).tolist() == corners_of(VERTICES).tolist() == [[[0, 0], [1, 0], [1, 1], [0, 1]]]


def test_patches_over_damage(tmp_path, comm, monkeypatch):
    """One cell that lies on the ramp, under the damage of what run_folder writes; pale fields have no legend entry for what is not there."""
    seen = []
    monkeypatch.setattr(patches_picture, "save", lambda figure, path: seen.append((figure, path)) or path)
    run_folder(tmp_path, comm, 2)
    write_enrichment(comm, tmp_path, {**VERTICES, "vertices/position": VERTICES["vertices/position"] * [0.02, 0.008]}, ATTRIBUTES)
    assert draw_patches(tmp_path) == tmp_path / "patches.png"
    axes = seen[0][0].axes[0]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["ramp between both: 1 cells"]
    assert axes.get_xlabel() == "x [mm]" and len(axes.images) == 2 and len(seen[0][0].axes) == 2
