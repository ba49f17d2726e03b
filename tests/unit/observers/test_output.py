from types import SimpleNamespace

from pdhpc.observers.output import HistoryOutput, columns, steps_of


def test_steps_nearest_to_times():
    assert steps_of([0.1, 0.24, 0.26, 1.0, 9.0], 0.1, 10) == [1, 2, 3, 10]
    assert steps_of([1e-9], 0.1, 10) == [1]


class Gauge:
    columns = ("a [m]", "b [s]")

    def read(self, stepper):
        return [stepper.step * 10, -1]


def test_rows_of_all_gauges_once_each():
    rows, prepared = [], []
    output = HistoryOutput(SimpleNamespace(append=rows.append, begin=rows.clear), [Gauge()], [2])
    assert columns([Gauge()]) == ["time [s]", "step", "a [m]", "b [s]"]
    view = SimpleNamespace(prepare=lambda: prepared.append(1))
    output.start(SimpleNamespace(step=0, time=0.0, view=view))
    output.observe(SimpleNamespace(step=2, time=0.2, view=view))
    output.finish(SimpleNamespace(step=2, time=0.2, view=view))
    assert [row["step"] for row in rows] == [0, 2] and rows[1] == {"time [s]": 0.2, "step": 2, "a [m]": 20, "b [s]": -1}
    output.finish(SimpleNamespace(step=3, time=0.3, view=view))
    assert rows[-1]["step"] == 3 and len(prepared) == len(rows), "what gauges read is brought up to date first"


def test_a_continued_history_begins_behind_its_rows():
    rows, view = [], SimpleNamespace(prepare=int)
    output = HistoryOutput(SimpleNamespace(append=rows.append, take_up=lambda step: step, resume=int), [Gauge()], [])
    going_on = SimpleNamespace(step=2, time=0.2, view=view)
    output.take_up(going_on)
    output.resume(going_on)
    output.finish(SimpleNamespace(step=2, time=0.2, view=view))
    assert rows == [], "the row of the step that it goes on from is there"
    output.finish(SimpleNamespace(step=4, time=0.4, view=view))
    assert [row["step"] for row in rows] == [4]
