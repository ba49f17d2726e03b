"""When checkpoints are written: at steps, after minutes, on signals, at the end."""
import signal
import time

from pdhpc.output.log import LOG
from pdhpc.parallel.comm import most_of_each
from pdhpc.run import Observer, StopRequested

_LOOK_EVERY = 0.2  # s, between two looks at the clock and at signals, on which ranks agree
_MOST = 1000  # steps between two looks


class Checkpoints(Observer):
    """Writes the state at every `steps` steps, every `minutes` minutes, on SIGUSR1, on SIGTERM and SIGINT (and stops), and at the end.

    Ranks agree on the clock and on signals at steps that they plan ahead from the pace of rank 0, some 0.2 s apart, with one reduction each. A second SIGTERM or
    SIGINT ends the process as it would have at first.
    """

    every = 1

    def __init__(self, comm, write, setting, n_steps):
        """write : function (stepper), writes a checkpoint; Collective. setting : scene.Checkpoint, or None for signals alone."""
        self.comm, self._write, self.n_steps = comm, write, n_steps
        self._steps = (setting.steps if setting is not None else None) or 0
        self._seconds = 60.0 * ((setting.minutes if setting is not None else None) or 0.0)
        self._at_end = setting is not None and setting.at_end
        self._asked, self._next, self._last = 0, 0, None
        self._before = {}

    def start(self, stepper):
        """Listen to signals from now on. Local."""
        self._written_at = self._looked_at = time.monotonic()
        self._looked, self._next, self._last = stepper.step, stepper.step + 1, stepper.step
        for each, weight in ((signal.SIGUSR1, 1), (signal.SIGTERM, 2), (signal.SIGINT, 2)):
            self._before[each] = signal.signal(each, lambda number, frame, weight=weight: self._hear(number, weight))

    resume = start

    def _hear(self, number, weight):
        """Take note of a signal; the second that asks to stop is left to what was there before."""
        if weight == 2 and self._asked == 2:
            self.close()
            signal.raise_signal(number)
        self._asked = max(self._asked, weight)

    def observe(self, stepper):
        """Write a checkpoint if one is due. Collective at the steps of a look, else local.

        Raises
        ------
        StopRequested: a signal asked for it; the checkpoint is written.
        """
        planned = bool(self._steps) and stepper.step % self._steps == 0
        if not planned and stepper.step < self._next:
            return
        asked = self._look(stepper.step)
        if planned or asked and stepper.step < self.n_steps:
            self._save(stepper)
        if asked == 2 and stepper.step < self.n_steps:
            raise StopRequested(f"stopped on request at step {stepper.step}, t = {stepper.time:.6g} s; pdhpc restart goes on from there")

    def _look(self, step):
        """Return what is asked for: 0, 1 (a checkpoint) or 2 (and to stop), and plan the next look. Collective."""
        now = time.monotonic()
        due = bool(self._seconds) and now - self._written_at >= self._seconds
        pace = (now - self._looked_at) / max(step - self._looked, 1)
        ahead = max(1, min(_MOST, int(_LOOK_EVERY / pace))) if pace > 0 else _MOST
        asked, ahead = most_of_each(self.comm, (max(self._asked, int(due)), ahead if self.comm.rank == 0 else 0))
        self._looked_at, self._looked, self._next = now, step, step + ahead
        return asked

    def _save(self, stepper):
        began = time.monotonic()
        self._write(stepper)
        self._written_at, self._last = time.monotonic(), stepper.step
        LOG.info(f"checkpoint of step {stepper.step}, {self._written_at - began:.3g} s")
        self._asked = 0 if self._asked == 1 else self._asked

    def finish(self, stepper):
        """Write the state of the end, if asked for. Collective."""
        if self._at_end and self._last != stepper.step:
            self._save(stepper)
        self.close()

    def close(self):
        """Leave signals to what was there before. Local."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}
