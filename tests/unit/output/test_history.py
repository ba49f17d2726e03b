import numpy as np
import pytest

from pdhpc.output.history import History, read_history
from pdhpc.output.record import OutputError


def test_round_trip_keeps_every_digit(tmp_path, comm):
    history = History(tmp_path / "h.csv", ["time [s]", "step", "a, b [m]"], comm)
    history.begin()
    rows = [(0.1, 1, 1 / 3), (0.2, 2, float("nan")), (np.float64(0.3), np.int64(3), float("inf"))]
    for row in rows:
        history.append(dict(zip(history.columns, row)))
    read = read_history(tmp_path / "h.csv")
    assert read["time [s]"].tolist() == [0.1, 0.2, 0.3] and read["a, b [m]"][0] == 1 / 3
    assert np.isnan(read["a, b [m]"][1]) and np.isinf(read["a, b [m]"][2])
    assert "\n1," not in (tmp_path / "h.csv").read_text() and ",3," in (tmp_path / "h.csv").read_text()


def test_a_torn_last_line_is_left_out(tmp_path, comm):
    history = History(tmp_path / "h.csv", ["a", "b"], comm)
    history.begin()
    history.append({"a": 1.0, "b": 2.0})
    with open(tmp_path / "h.csv", "a") as file:
        file.write("3.0,4")
    assert read_history(tmp_path / "h.csv")["a"].tolist() == [1.0]


def test_a_folder_that_is_gone(tmp_path, comm):
    with pytest.raises(OutputError, match="cannot be written"):
        History(tmp_path / "nowhere" / "h.csv", ["a"], comm).begin()


def test_a_continued_history_keeps_the_rows_up_to_its_step(tmp_path, comm):
    history = History(tmp_path / "h.csv", ["step", "a, b [m]"], comm)
    history.begin()
    for step in (0, 5, 10):
        history.append({"step": step, "a, b [m]": step / 3})
    with open(tmp_path / "h.csv", "a") as file:
        file.write("15,")
    again = History(tmp_path / "h.csv", ["step", "a, b [m]"], comm)
    assert again.take_up(7) == 5 and len(read_history(tmp_path / "h.csv")["step"]) == 3
    again.resume()
    again.append({"step": 8, "a, b [m]": 8 / 3})
    assert read_history(tmp_path / "h.csv")["a, b [m]"].tolist() == [0.0, 5 / 3, 8 / 3]
    assert again.take_up(4) == 0 and History(tmp_path / "h.csv", ["step", "a, b [m]"], comm).take_up(-1) == -1
    with pytest.raises(OutputError, match="its columns are not those of this run"):
        History(tmp_path / "h.csv", ["step"], comm).take_up(4)
    assert History(tmp_path / "other.csv", ["step"], comm).take_up(4) is None
    for content in ("step\nx\n", "step\n1.5\n", "step\n\0\n"):
        (tmp_path / "other.csv").write_text(content)
        with pytest.raises(OutputError, match="cannot be continued .*; allowed is the history as the run left it") as caught:
            History(tmp_path / "other.csv", ["step"], comm).take_up(4)
        assert caught.value.exit_code == 2
