import os
import signal
import time
from types import SimpleNamespace

import pytest

from pdhpc.observers import checkpoint
from pdhpc.observers.checkpoint import Checkpoints
from pdhpc.run import StopRequested, drive

SETTING = {"steps": None, "minutes": None, "at_end": False}


class Stepper:
    """Does nothing, step by step; `acts` by step."""

    dt = 0.1

    def __init__(self, acts=None, first=0):
        self.step, self.acts = first, acts or {}

    @property
    def time(self):
        return self.step * self.dt

    def advance(self):
        self.step += 1
        self.acts.get(self.step, int)()


def saved(comm, stepper, n_steps=20, **setting):
    """The steps at which a run of `stepper` saved its state."""
    steps = []
    drive(stepper, n_steps, [Checkpoints(comm, lambda stepper: steps.append(stepper.step), SimpleNamespace(**{**SETTING, **setting}), n_steps)], {})
    return steps


@pytest.fixture(autouse=True)
def looks_at_every_step(monkeypatch):
    monkeypatch.setattr(checkpoint, "_LOOK_EVERY", 0.0)


def signalled(number):
    return lambda: os.kill(os.getpid(), number)


def test_steps_and_the_end(comm):
    assert saved(comm, Stepper(), steps=8) == [8, 16]
    assert saved(comm, Stepper(), steps=8, at_end=True) == [8, 16, 20]
    assert saved(comm, Stepper(), steps=10, at_end=True) == [10, 20], "the end is not saved twice"
    assert saved(comm, Stepper(first=11), steps=8) == [16], "steps are those of the whole run"
    assert saved(comm, Stepper()) == []


def test_minutes(comm):
    slow = {5: lambda: time.sleep(0.06), 12: lambda: time.sleep(0.06)}
    assert saved(comm, Stepper(slow), minutes=0.05 / 60) == [5, 12]


def test_a_signal_saves_and_one_that_stops_stops(comm):
    assert saved(comm, Stepper({3: signalled(signal.SIGUSR1)})) == [3]
    steps = []
    for number in (signal.SIGTERM, signal.SIGINT):
        before = signal.getsignal(number)
        watch = Checkpoints(comm, lambda stepper: steps.append(stepper.step), None, 20)
        with pytest.raises(StopRequested, match="stopped on request at step 7, t = 0.7 s; pdhpc restart"):
            drive(Stepper({7: signalled(number)}), 20, [watch], {})
        watch.close()
        assert signal.getsignal(number) is before
    assert steps == [7, 7]


def test_in_the_last_step_there_is_nothing_to_stop(comm):
    assert saved(comm, Stepper({20: signalled(signal.SIGTERM)}), at_end=True) == [20]


def test_a_second_signal_ends_the_process_as_it_would_have(comm):
    before = signal.signal(signal.SIGTERM, lambda number, frame: (_ for _ in ()).throw(KeyboardInterrupt))
    try:
        def twice():
            os.kill(os.getpid(), signal.SIGTERM)
            os.kill(os.getpid(), signal.SIGTERM)

        with pytest.raises(KeyboardInterrupt):
            drive(Stepper({3: twice}), 20, [Checkpoints(comm, print, None, 20)], {})
    finally:
        signal.signal(signal.SIGTERM, before)


def test_looks_are_planned_by_the_pace(comm, monkeypatch):
    monkeypatch.setattr(checkpoint, "_LOOK_EVERY", 0.05)
    watch, looks = Checkpoints(comm, print, None, 400), []
    look = watch._look
    monkeypatch.setattr(watch, "_look", lambda step: looks.append(step) or look(step))
    stepper = Stepper(dict.fromkeys(range(1, 401), lambda: time.sleep(0.001)))
    drive(stepper, 400, [watch], {})
    assert 3 <= len(looks) <= 30, "some 0.05 s apart in 0.4 s or more"
