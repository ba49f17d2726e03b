"""The drive loop: advances anything that has advance(), state() and ledger(), and lets observers watch.

Multi-time-step and coupled steppers are driven by the same loop; what a stepper calls one step (dt, macro step, coupled step) is its own business.
"""
import time


class RunError(RuntimeError):
    """A run that cannot go on: one sentence with the number that shows it."""


class StopRequested(RuntimeError):
    """A run that stops because it was asked to, its state saved."""


class Observer:
    """Watches a run. `steps` is the sorted list of steps it wants to see, or an interval given as `every`."""

    steps = ()
    every = 0

    def start(self, stepper):
        """Look at the initial state. Collective."""

    def take_up(self, stepper):
        """Look at what the run that goes on has left, before anything is changed; return warnings, raise what keeps it from going on. Collective."""
        return []

    def resume(self, stepper):
        """Look at the state that a run goes on from, in the place of `start`. Collective."""

    def state(self):
        """Return {key: Entry} of what the observer needs to go on."""
        return {}

    def observe(self, stepper):
        """Look at the state after one of its steps. Collective."""

    def finish(self, stepper):
        """Look at the final state. Collective."""

    def salvage(self, stepper):
        """Write what there is of a step that failed; its state is finite. Collective."""

    def close(self):
        """Give back what was taken, also after a failure. Local."""


def drive(stepper, n_steps, observers, seconds, resumed=False):
    """Advance `stepper` until it has done n_steps, calling each observer after the steps it asked for. Collective.

    seconds : dict, gains "observe": wall seconds spent in observers. resumed : whether the run goes on from a checkpoint.
    """
    _timed(seconds, observers, "resume" if resumed else "start", stepper)
    schedule = _schedule(observers, stepper.step, n_steps)
    while stepper.step < n_steps:
        stepper.advance()
        due = schedule.get(stepper.step, ()) if schedule else ()
        periodic = [observer for observer in observers if observer.every and stepper.step % observer.every == 0]
        if due or periodic:
            _timed(seconds, [observer for observer in observers if observer in due or observer in periodic], "observe", stepper)
    _timed(seconds, observers, "finish", stepper)


def _schedule(observers, first, last):
    """Return {step: [observers]} of the listed steps after `first`."""
    schedule = {}
    for observer in observers:
        for step in observer.steps:
            if first < step <= last:
                schedule.setdefault(int(step), []).append(observer)
    return schedule


def _timed(seconds, observers, action, stepper):
    started = time.perf_counter()
    for observer in observers:
        getattr(observer, action)(stepper)
    seconds["observe"] = seconds.get("observe", 0.0) + time.perf_counter() - started
