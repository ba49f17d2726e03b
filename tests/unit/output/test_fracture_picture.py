"""The three views of a fractured 3D body, from output files alone."""
import numpy as np
import pytest

from pdhpc.output import fracture_picture
from pdhpc.output.fields import FieldWriter
from pdhpc.output.fracture_picture import View, draw_fracture

SIZE = 1e-3


def run_folder(folder, comm, dim=3, names=("damage", "displacement", "precrack")):
    """Write a block of 20 x 8 x 6 particles: damage 1 in a layer at y = 4.5 mm for x > 5 mm, a pre-crack there for x < 5 mm; a first frame is whole."""
    axes = np.meshgrid(*[np.arange(n) + 0.5 for n in (20, 8, 6)[:dim]], indexing="ij")
    x = SIZE * np.stack([axis.ravel() for axis in axes], axis=1)
    n, layer = len(x), np.abs(x[:, 1] - 4.5e-3) < 1e-6
    writer = FieldWriter(comm, folder, {})
    writer.write_points(np.arange(n), x, np.full(n, SIZE**3), np.zeros(n))
    fields = {"damage": 1.0 * (layer & (x[:, 0] > 5e-3)), "displacement": np.zeros_like(x), "precrack": 1.0 * (layer & (x[:, 0] < 5e-3))}
    fields = {name: fields[name] for name in names}
    writer.write_frame(0, 0.0, {**fields, "damage": np.zeros(n)} if "damage" in names else fields)
    writer.write_frame(3, 1e-6, fields)
    return x


@pytest.fixture
def painted(monkeypatch):
    """What the views are painted from: {title: (canvas, behind)}."""
    seen = {}

    def paint(directory, frame, views, rigids):
        seen.update({title: (canvas, behind) for title, canvas, behind in views})
        return whole(directory, frame, views, rigids)

    whole = fracture_picture._paint
    monkeypatch.setattr(fracture_picture, "_paint", paint)
    return seen


def shown(canvas):
    """Return (share of the frame that is covered, values seen)."""
    return np.isfinite(canvas.depth).mean(), set(np.unique(canvas.value[np.isfinite(canvas.value)]))


def test_three_views(tmp_path, comm, painted):
    """Seen from in front (-y): the surface hides the layer, the cut through it shows it, and alone it covers what a face covers."""
    run_folder(tmp_path, comm)
    path = draw_fracture(tmp_path, View(azimuth=-90.0, elevation=0.0, cut=(1, 4.1e-3)))
    assert path.name == "fracture.png" and path.read_bytes()[:4] == b"\x89PNG" and not list(tmp_path.glob("*.part*"))
    surface, cut, damaged = (painted[title][0] for title in ("surface", "cut at y = 0.0041 m", "damage from 0.35 on"))
    covered, values = shown(surface)
    assert covered > 0.95 and values == {0.0}
    covered, values = shown(cut)
    assert covered > 0.95 and values == {1.0, -1.0}
    precracked = (cut.value == -1.0).sum() / np.isfinite(cut.value).sum()
    assert precracked == pytest.approx(5 / 20, abs=0.03), "a quarter of the layer"
    assert np.array_equal(damaged.value, cut.value, equal_nan=True) and painted["damage from 0.35 on"][1] is surface
    depth = surface.depth[np.isfinite(surface.depth)].max()
    assert depth == pytest.approx(-0.5e-3 + 0.71e-3, rel=0.01), "the foremost balls, of 0.71 particles' size"


def test_from_above_nothing_is_in_front_of_the_layer(tmp_path, comm, painted):
    run_folder(tmp_path, comm)
    draw_fracture(tmp_path, View(azimuth=-90.0, elevation=90.0))
    values = shown(painted["surface"][0])[1]
    assert values == {0.0, 1.0, -1.0}


def test_the_cut_takes_away_what_faces_the_camera(tmp_path, comm, painted):
    """From +y what remains lies at smaller y; half way is where it is cut by default."""
    run_folder(tmp_path, comm)
    draw_fracture(tmp_path, View(azimuth=90.0, elevation=0.0))
    canvas = painted["cut at y = 0.004 m"][0]
    assert canvas.depth[np.isfinite(canvas.depth)].max() == pytest.approx(3.5e-3 + 0.71e-3, rel=0.01)


def test_frames_and_thresholds_are_chosen(tmp_path, comm, painted):
    run_folder(tmp_path, comm)
    draw_fracture(tmp_path, View(frame=0, above=0.5))
    assert shown(painted["surface"][0])[1] == {0.0, -1.0} and shown(painted["damage from 0.5 on"][0])[1] == {-1.0}


def test_fragments_that_flew_far_do_not_shrink_the_body(tmp_path, comm, painted):
    x = run_folder(tmp_path, comm)
    away = np.zeros_like(x)
    away[0], away[1] = 5.0, np.nan
    writer = FieldWriter(comm, tmp_path, {})
    writer.write_points(np.arange(len(x)), x, np.full(len(x), SIZE**3), np.zeros(len(x)))
    writer.write_frame(0, 0.0, {"damage": np.zeros(len(x)), "displacement": away})
    draw_fracture(tmp_path)
    canvas = painted["surface"][0]
    assert max(canvas.value.shape) * canvas.pixel < 0.05, "22 mm from corner to corner, and half as much beyond: not 5 m"
    assert shown(canvas)[0] > 0.1


@pytest.mark.parametrize("dim, names", [(2, ("damage", "displacement")), (3, ("displacement",))])
def test_nothing_to_draw(tmp_path, comm, dim, names):
    run_folder(tmp_path, comm, dim, names)
    assert draw_fracture(tmp_path) is None
