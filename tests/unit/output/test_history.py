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


def continued(comm, path, rows, crc):
    """A History of a run that had written some rows when its state was saved."""
    history = History(path, ["step", "a, b [m]"], comm)
    for key, value in {"history/rows": rows, "history/crc": crc}.items():
        history.state()[key].set(value)
    return history


def test_a_continued_history_keeps_the_rows_up_to_its_step(tmp_path, comm):
    history, saved = History(tmp_path / "h.csv", ["step", "a, b [m]"], comm), {}
    history.begin()
    for step in (0, 5, 10):
        history.append({"step": step, "a, b [m]": step / 3})
        saved[step] = history.rows, history.crc
    with open(tmp_path / "h.csv", "a") as file:
        file.write("15,")
    again = continued(comm, tmp_path / "h.csv", *saved[5])
    assert again.take_up(7) == 5 and len(read_history(tmp_path / "h.csv")["step"]) == 3
    again.resume()
    again.append({"step": 8, "a, b [m]": 8 / 3})
    assert read_history(tmp_path / "h.csv")["a, b [m]"].tolist() == [0.0, 5 / 3, 8 / 3] and again.rows == 3
    assert continued(comm, tmp_path / "h.csv", *saved[0]).take_up(4) == 0 and continued(comm, tmp_path / "h.csv", 0, 0).take_up(-1) == -1
    assert continued(comm, tmp_path / "other.csv", *saved[5]).take_up(7) is None


def test_a_history_must_have_the_rows_that_the_run_wrote(tmp_path, comm):
    """One row less, one twice, another number, one without a step, other columns, no text."""
    path = tmp_path / "h.csv"
    history = History(path, ["step", "a, b [m]"], comm)
    history.begin()
    for step in (0, 5, 10):
        history.append({"step": step, "a, b [m]": step / 3})
    lines = path.read_text().splitlines()
    cases = {"its 2 rows up to step 10 are not the 3 that the run wrote": lines[:2] + lines[3:], "its 4 rows": lines[:2] + lines[1:], "its 3 rows": [*lines[:3], "10,3.5"],
             "a row without a step": [*lines[:3], "1.5,3.5"], "columns": ["step"], "contains NUL|without a step|columns": [lines[0], "\0,1"]}
    for words, content in cases.items():
        path.write_text("\n".join(content) + "\n")
        with pytest.raises(OutputError, match=f"cannot be continued .*({words}).*; allowed is the history as the run left it, or none") as caught:
            continued(comm, path, history.rows, history.crc).take_up(10)
        assert caught.value.exit_code == 2
