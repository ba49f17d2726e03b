import pytest

from pdhpc.run import Observer, RunError, drive


class Counter:
    """A stepper that only counts."""

    def __init__(self):
        self.step = 0

    def advance(self):
        self.step += 1


class Listener(Observer):
    def __init__(self, steps=(), every=0):
        self.steps, self.every, self.seen = steps, every, []

    def start(self, stepper):
        self.seen.append("start")

    def observe(self, stepper):
        self.seen.append(stepper.step)

    def finish(self, stepper):
        self.seen.append("finish")


def test_observers_see_the_steps_they_asked_for():
    listed, periodic, both = Listener([2, 3, 99]), Listener(every=4), Listener([4, 5], every=2)
    seconds = {}
    drive(Counter(), 8, [listed, periodic, both], seconds)
    assert listed.seen == ["start", 2, 3, "finish"]
    assert periodic.seen == ["start", 4, 8, "finish"]
    assert both.seen == ["start", 2, 4, 5, 6, 8, "finish"]
    assert seconds["observe"] > 0


def test_an_observer_can_stop_the_run():
    class Stop(Observer):
        every = 3

        def observe(self, stepper):
            raise RunError("enough")

    stepper = Counter()
    with pytest.raises(RunError, match="enough"):
        drive(stepper, 10, [Stop()], {})
    assert stepper.step == 3
