import json

import numpy as np
import pytest

from pdhpc.output.fields import FieldWriter
from pdhpc.output.history import History
from pdhpc.output.picture import draw


def run_folder(folder, comm, dim):
    axes = np.meshgrid(*[np.arange(n) + 0.5 for n in (20, 8, 6)[:dim]], indexing="ij")
    x = 1e-3 * np.stack([axis.ravel() for axis in axes], axis=1)
    n = len(x)
    writer = FieldWriter(comm, folder, {})
    writer.write_points(np.arange(n), x, np.ones(n), np.zeros(n))
    damage = (np.abs(x[:, 1] - 4e-3) < 1e-3) * 0.5
    writer.write_frame(3, 1e-6, {"damage": damage, "displacement": 1e-3 * x, "precrack": damage * (x[:, 0] < 5e-3)})
    history = History(folder / "history.csv", ["time [s]", "step", "kinetic_energy [J]", "tip.x [m]", "tip.speed [m/s]", "g.u [m]", "g.f [N]"], comm)
    history.begin()
    for number in range(4):
        history.append(dict(zip(history.columns, [number * 1e-6, number, 2.0 * number, 0.01 * number, 100.0, number, number**2])))
    return x, damage


@pytest.mark.parametrize("dim", [2, 3])
def test_every_picture_that_there_is_data_for(tmp_path, comm, dim):
    run_folder(tmp_path, comm, dim)
    drawn = draw(tmp_path, [("load", "g.u [m]", "g.f [N]")])
    names = {"damage.png", "displacement.png", "deformed.png", "energies.png", "tip_tip.png", "curve_load.png"}
    assert {path.name for path in drawn} == names | ({"fracture.png"} if dim == 3 else set())
    assert all(path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 3000 for path in drawn)
    assert not list(tmp_path.glob("*.part*"))


def test_nothing_to_draw(tmp_path):
    assert draw(tmp_path) == []


def test_particles_of_a_small_plane_body_are_drawn_where_they_are(tmp_path, comm, monkeypatch):
    """As pixels, particles that move apart would leave holes, and those that meet hide each other. 160 of 1 mm, u = 0.001 x, drawn 20 times."""
    from pdhpc.output import picture

    seen = []
    monkeypatch.setattr(picture, "save", lambda figure, path: seen.append((figure, path)) or path)
    x, damage = run_folder(tmp_path, comm, 2)
    draw(tmp_path)
    axes = next(figure for figure, path in seen if path.name == "deformed.png").axes[0]
    drawn = np.array([path.vertices[:4].mean(axis=0) for path in axes.collections[0].get_paths()])
    assert drawn == pytest.approx(1e3 * x * 1.02) and np.array_equal(axes.collections[0].get_array(), damage)
    monkeypatch.setattr(picture, "_MOST_SQUARES", 100)
    seen.clear()
    draw(tmp_path)
    assert len(next(figure for figure, path in seen if path.name == "deformed.png").axes[0].images) == 1


@pytest.mark.parametrize("dim", [2, 3])
def test_long_titles_stay_in_their_pictures_and_load_paths_have_no_microseconds(tmp_path, comm, monkeypatch, dim):
    import matplotlib.pyplot as plt

    from pdhpc.output import fracture_picture, picture

    seen = {}
    for module in (picture, fracture_picture):
        monkeypatch.setattr(module, "save", lambda figure, path: seen.setdefault(path.name, figure) and path)
    run_folder(tmp_path, comm, dim)
    (tmp_path / "run.json").write_text(json.dumps({"title": "Wide words of a title that goes on and on, " * 8, "equilibrium": {}, "scene": {}}))
    draw(tmp_path, [("load", "g.u [m]", "g.f [N]")])
    for name, figure in seen.items():
        figure.canvas.draw()
        titles = [figure._suptitle] if figure._suptitle is not None else [axes.title for axes in figure.axes[:1]]
        boxes = [title.get_window_extent() for title in titles]
        assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.width > 300 for box in boxes), name
    assert seen["energies.png"].axes[0].get_xlabel().startswith("load parameter") and seen["energies.png"].axes[0].lines[0].get_xdata().max() == 3e-6
    assert seen["tip_tip.png"].axes[1].get_xlabel().startswith("load parameter")
    plt.close("all")
