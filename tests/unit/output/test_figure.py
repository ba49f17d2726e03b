import json
from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.output.figure import beside, crack_colours, figure_of, length_unit, planes_of, rounded, save, small_unit, squares, time_axis, time_text, title_of
from pdhpc.output.record import OutputError

BODY = SimpleNamespace(lower=np.zeros(3), upper=np.array([2.0, 1.0, 0.5]), spacing=0.0, dim=3)


def test_three_planes_in_the_proportions_of_the_body():
    figure, axes = figure_of(BODY, planes_of(BODY))
    assert planes_of(BODY) == [(0, 1), (0, 2), (1, 2)] and len(axes) == 3 and figure.get_size_inches()[0] == 9.0
    assert length_unit(BODY) == ("m", 1.0)
    assert length_unit(SimpleNamespace(lower=np.full(2, 0.05), upper=np.full(2, 0.95), spacing=0.1)) == ("m", 1.0)  # centres of particles in a square of 1 m
    assert length_unit(SimpleNamespace(lower=np.zeros(2), upper=np.full(2, 0.05), spacing=0.1)) == ("mm", 1e3)


def test_numbers_in_words(tmp_path):
    assert [rounded(x) for x in (1.0, 4.9, 5.1, 19.0, 0.03)] == [1.0, 2.0, 5.0, 10.0, 0.02]
    assert [time_text(t) for t in (0.0, 2.0, 3e-3, 4e-6, 5e-9)] == ["0 s", "2 s", "3 ms", "4 µs", "5 ns"]
    assert title_of(tmp_path) == tmp_path.name
    (tmp_path / "run.json").write_text(json.dumps({"title": "A plate"}))
    assert title_of(tmp_path) == "A plate"


def test_a_disk_without_room(tmp_path):
    figure, _ = figure_of(BODY, [(0, 1)])
    with pytest.raises(OutputError, match=r"nowhere/a.png: cannot be written \(No such file or directory\)"):
        save(figure, tmp_path / "nowhere" / "a.png")


def test_long_titles_take_two_lines_and_end_there(tmp_path):
    (tmp_path / "run.json").write_text(json.dumps({"title": "A thin plate of glass " * 4}))
    first, second = title_of(tmp_path).split("\n")
    assert f"{first} {second}" == ("A thin plate of glass " * 4).strip() and len(first) <= 64
    (tmp_path / "run.json").write_text(json.dumps({"title": "word " * 100}))
    lines = title_of(tmp_path).split("\n")
    assert len(lines) == 2 and all(len(line) <= 64 for line in lines) and lines[1].endswith("word ...")


def test_axes_of_time(tmp_path):
    """Seconds, ms or us by the longest time; of bodies that stand still, and of one static step, the parameter of the load path."""
    assert [time_axis(tmp_path, last) for last in (2.0, 3e-3, 4e-6)] == [("time [s]", 1.0), ("time [ms]", 1e3), ("time [µs]", 1e6)]
    for record in ({"equilibrium": {}}, {"integration": "static"}):
        (tmp_path / "run.json").write_text(json.dumps(record))
        assert time_axis(tmp_path, 3e-6) == ("load parameter: time of the load path [s]", 1.0)
    (tmp_path / "run.json").write_text(json.dumps({"integration": "explicit"}))
    assert time_axis(tmp_path, 1.0) == ("time [s]", 1.0)


def test_units_of_small_lengths():
    assert [small_unit(x)[0] for x in (3.0, 0.02, 5e-3, 2e-5, 3e-6, 4e-9, 0.0)] == ["m", "m", "mm", "mm", "µm", "nm", "m"]
    assert all(factor == {"m": 1.0, "mm": 1e3, "µm": 1e6, "nm": 1e9}[name] for name, factor in (small_unit(x) for x in (1.0, 1e-3, 1e-6, 1e-9)))


def test_squares_and_a_bar_beside_them():
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    shown = axes.add_collection(squares(np.array([[0.0, 0.0], [2.0, 1.0]]), 0.5, np.array([1.0, 3.0]), cmap=crack_colours()))
    beside(figure, axes, shown, "damage")
    assert [path.vertices[:4].tolist() for path in shown.get_paths()][1] == [[1.75, 0.75], [2.25, 0.75], [2.25, 1.25], [1.75, 1.25]]
    assert len(axes.child_axes) == 1 and axes.child_axes[0].get_ylabel() == "damage"
