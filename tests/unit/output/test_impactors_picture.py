"""Where pictures show impactors, against what geometry says."""
import json

import matplotlib
import numpy as np
import pytest

from pdhpc.output.fields import FieldWriter
from pdhpc.output.history import History
from pdhpc.output.impactors_picture import Rigid, draw_outlines, front, outline, reach_of, read_impactors, tint
from pdhpc.output.rendering import Camera, Canvas

matplotlib.use("Agg")

FRONT = Camera.at(-90.0, 0.0)  # seen along y: x to the right, z up
BALL = {"name": "ball", "shape": "sphere", "center": [0.0, 0.0, 9.0], "radius": 2.0}


def rigid(shape, place=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 0.0), radius=2.0, half_length=np.inf):
    return Rigid(shape, np.array(place, float), np.zeros(3), np.array(axis, float), radius, half_length)


def run_folder(folder, comm, tables, positions, dim=3):
    """Write the record of a run with impactors, and their positions at the steps 0, 5, 10, ..."""
    (folder / "run.json").write_text(json.dumps({"title": "t", "scene": {"impactor": tables}}))
    columns = [f"{table['name']}.position_{x} [m]" for table in tables for x in "xyz"[:dim]]
    history = History(folder / "history.csv", ["time [s]", "step", *columns], comm)
    history.begin()
    for number, place in enumerate(positions):
        history.append(dict(zip(history.columns, [number * 1e-6, 5 * number, *np.ravel(place)])))


def test_impactors_are_read_where_the_frame_had_them(tmp_path, comm):
    tables = [BALL, {"name": "rod", "shape": "cylinder", "center": [1.0, 0.0, 0.0], "radius": 0.5, "axis": [0.0, 2.0, 0.0], "length": 4.0},
              {"name": "floor", "shape": "plane", "point": [0.0, 0.0, -1.0], "normal": [0.0, 0.0, 3.0]}]
    run_folder(tmp_path, comm, tables, [[[0, 0, 9 - k], [1, k, 0], [0, 0, -1]] for k in range(3)])
    ball, rod, floor = read_impactors(tmp_path, 10)
    assert ball.place.tolist() == [0, 0, 7] and ball.start.tolist() == [0, 0, 9] and ball.radius == 2.0 and ball.bounded
    assert ball.moved(3.0).place.tolist() == [0, 0, 3], "2 m of way, three times"
    assert rod.place.tolist() == [1, 2, 0] and rod.axis.tolist() == [0, 1, 0] and rod.half_length == 2.0 and rod.bounded
    assert floor.axis.tolist() == [0, 0, 1] and not floor.bounded
    assert read_impactors(tmp_path, 7) == [], "a step of which the history tells nothing"
    assert read_impactors(tmp_path / "nowhere", 0) == []


def test_a_disk_of_a_plane_body(tmp_path, comm):
    run_folder(tmp_path, comm, [{"name": "ball", "shape": "cylinder", "center": [1.0, 2.0], "radius": 0.5}], [[1.0, 2.0], [1.0, 1.5]], dim=2)
    (disk,) = read_impactors(tmp_path, 5)
    assert disk.bounded and disk.place.tolist() == [1.0, 1.5, 0.0]
    assert np.linalg.norm(outline(disk, (0, 1), 100.0) - [1.0, 1.5], axis=1) == pytest.approx(np.full(96, 0.5))


def test_outlines():
    """A ball is a circle whichever way one looks; a cylinder from the side a rectangle; a plane is seen edge on or not at all."""
    circle = outline(rigid("sphere", (1, 2, 3)), (0, 2), 9.0)
    assert np.linalg.norm(circle - [1, 3], axis=1) == pytest.approx(np.full(len(circle), 2.0))
    side = outline(rigid("cylinder", axis=(1, 0, 0), radius=1.0, half_length=3.0), (0, 1), 9.0)
    assert np.abs(side).max(axis=0) == pytest.approx([3.0, 1.0]) and np.abs(side[:, 0]) == pytest.approx(np.full(len(side), 3.0))
    assert np.abs(outline(rigid("cylinder", axis=(1, 0, 0), radius=1.0), (0, 1), 9.0)).max() == pytest.approx(9.0), "without ends: as far as anything is shown"
    line = outline(rigid("plane", (0, 0, -1), (0, 0, 1)), (0, 2), 9.0)
    assert np.abs(line).tolist() == [[9.0, 1.0], [9.0, 1.0]] and outline(rigid("plane", axis=(0, 0, 1)), (0, 1), 9.0) is None


def test_maps_are_widened_for_a_ball_but_not_for_ever():
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots()
    axes.imshow(np.zeros((4, 10)), extent=[0.0, 10.0, 0.0, 4.0], origin="lower")
    draw_outlines(axes, [rigid("sphere", (5, 0, 0), radius=3.0), rigid("plane", (0, -1, 0), (0, 1, 0)), rigid("sphere", (5, 99, 0), radius=1.0)], (0, 1), 1.0)
    assert axes.get_ylim() == pytest.approx((-3.0, 9.0)) and axes.get_xlim() == (0.0, 10.0), "5 beyond the map at most"
    assert len(axes.lines) == 3
    plt.close(figure)


def canvas():
    return Canvas(FRONT, (-5.0, -5.0), (5.0, 5.0), 100)


def test_depth_of_a_ball_and_of_what_a_cut_leaves_of_it():
    """The camera stands at -y: the foremost point of a ball around y = 1 has depth 1 = -(1 - 2); cut at y = 1.5 it is a flat disk of depth -1.5."""
    ball = rigid("sphere", (0, 1, 0))
    depth = front(ball, canvas())
    assert np.isfinite(depth).mean() == pytest.approx(np.pi * 4 / 100, rel=0.01) and depth.max() == pytest.approx(1.0, abs=1e-2)
    cut = front(ball, canvas(), (np.array([0.0, 1.0, 0.0]), 1.5))
    assert np.isfinite(cut).mean() == pytest.approx(np.pi * (4 - 0.25) / 100, rel=0.01)
    assert cut[np.isfinite(cut)].max() == pytest.approx(-1.5)


def test_depth_of_cylinders_and_planes():
    upright = front(rigid("cylinder", axis=(0, 0, 1), radius=1.0, half_length=3.0), canvas())
    assert np.isfinite(upright).mean() == pytest.approx(2 * 6 / 100, rel=0.02) and upright.max() == pytest.approx(1.0, abs=1e-2)
    end_on = front(rigid("cylinder", axis=(0, 1, 0), radius=1.0, half_length=3.0), canvas())
    assert np.isfinite(end_on).mean() == pytest.approx(np.pi / 100, rel=0.02) and end_on[np.isfinite(end_on)] == pytest.approx(3.0)
    assert not np.isfinite(front(rigid("cylinder", axis=(0, 1, 0), radius=1.0), canvas())).any(), "without an end towards the camera"
    wall = front(rigid("plane", (0, 2, 0), (0, -1, 0)), canvas())
    assert wall == pytest.approx(np.full(wall.shape, -2.0)) and not np.isfinite(front(rigid("plane", (0, 2, 0), (0, 1, 0)), canvas())).any()


def test_the_frame_of_a_leaning_cylinder():
    """Of radius 1 and half length 3, its axis 30 degrees from the horizontal: 3 cos + sin wide, 3 sin + cos high."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    low, high = reach_of(rigid("cylinder", (1, 0, 2), (c, 0, s), 1.0, 3.0), FRONT)
    assert high - [1, 2] == pytest.approx([3 * c + s, 3 * s + c]) and low + high == pytest.approx([2, 4])


def test_a_ball_tints_what_it_hides_and_nothing_else():
    picture, image = canvas(), np.ones((100, 100, 3))
    picture.depth[:50] = 5.0  # the lower half is in front of it
    seen = (tint(image, picture, [rigid("sphere")]) < 1.0).any(axis=2)
    assert not seen[:50].any() and seen[50:].mean() == pytest.approx(np.pi * 2 / 50, rel=0.03)


@pytest.mark.parametrize("dim", [2, 3])
def test_pictures_of_a_run_show_them(tmp_path, comm, dim, monkeypatch):
    """Frames 0 and 1: the disk or ball is drawn around where the history has it."""
    import matplotlib.pyplot as plt

    from pdhpc.output import picture
    from pdhpc.output.fracture_picture import View

    axes = np.meshgrid(*[np.arange(n) + 0.5 for n in (12, 8, 4)[:dim]], indexing="ij")
    x = 1e-3 * np.stack([axis.ravel() for axis in axes], axis=1)
    writer = FieldWriter(comm, tmp_path, {})
    writer.write_points(np.arange(len(x)), x, np.full(len(x), 1e-3**dim), np.zeros(len(x)))
    for step in (0, 5):
        writer.write_frame(step, 1e-6 * step, {"damage": np.zeros(len(x)), "displacement": np.zeros_like(x)})
    table = {"name": "ball", "shape": "sphere" if dim == 3 else "cylinder", "center": [6e-3, 11e-3, 2e-3][:dim], "radius": 2e-3}
    run_folder(tmp_path, comm, [table], [[6e-3, 11e-3, 2e-3][:dim], [6e-3, 10e-3, 2e-3][:dim]], dim)
    seen = {}
    monkeypatch.setattr(picture, "save", lambda figure, path: seen.update({path.name: figure}) or path)
    picture.draw(tmp_path, view=View(frame=1))
    for name in ("damage.png", "deformed.png"):
        (line,) = seen[name].axes[0].lines
        assert np.mean(line.get_xydata()[:-1], axis=0) == pytest.approx([6.0, 10.0]), "mm"
    picture.draw(tmp_path, view=View(frame=0))
    assert np.mean(seen["damage.png"].axes[0].lines[0].get_xydata()[:-1], axis=0) == pytest.approx([6.0, 11.0])
    plt.close("all")
