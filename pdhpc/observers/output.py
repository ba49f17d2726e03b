"""Output of fields and of history rows at their steps."""
import numpy as np

from pdhpc.output.log import LOG
from pdhpc.run import Observer


class FieldOutput(Observer):
    """Write the fields of all particles at the listed steps, the initial and the final state included."""

    def __init__(self, writer, names, steps, computed=None):
        """computed : {name: function () -> field}, Collective, of fields that the view does not have."""
        self.writer, self.names, self.steps, self.computed = writer, names, steps, computed or {}
        self._last, self._anew = None, False

    def start(self, stepper):
        """Write the particles and the initial state. Collective."""
        view = stepper.view
        self.writer.write_points(view.ids, view.places(), view.volume, view.block, view.cells)
        self.observe(stepper)

    def observe(self, stepper):
        """Write one frame. Collective."""
        stepper.view.prepare()
        self.writer.write_frame(stepper.step, stepper.time, {name: self._field(stepper, name) for name in self.names})
        self._last = stepper.step
        LOG.info(f"frame of step {stepper.step}, t = {stepper.time:.6g} s")

    def salvage(self, stepper):
        """Write the state of a step that failed. Collective."""
        self.observe(stepper)

    def take_up(self, stepper):
        """Find the frames that are there. Collective."""
        warnings = self.writer.take_up(stepper.view.ids, stepper.step)
        self._anew = warnings is None
        return [f"{self.writer.directory}: its fields are not there any more: they begin anew at step {stepper.step}"] if self._anew else warnings

    def resume(self, stepper):
        """Go on behind the frames that are there, or begin anew without any. Collective."""
        if self._anew:
            return self.start(stepper)
        self.writer.resume()
        self._last = self.writer.frames[-1][1] if self.writer.frames else None

    def _field(self, stepper, name):
        return self.computed[name]() if name in self.computed else stepper.view.field(name)

    def finish(self, stepper):
        """Write the final state unless it is there. Collective."""
        if self._last != stepper.step:
            self.observe(stepper)


class HistoryOutput(Observer):
    """Append a row of all gauges (energies, probes, tips) at the listed steps, the initial and the final state included.

    A gauge has `columns` and read(stepper) -> values.
    """

    def __init__(self, history, gauges, steps):
        self.history, self.gauges, self.steps = history, gauges, steps
        self._last = None

    def start(self, stepper):
        """Write the row of the initial state. Collective."""
        self.history.begin()
        self.observe(stepper)

    def salvage(self, stepper):
        """Append a row of a step that failed. Collective."""
        self.observe(stepper)

    def take_up(self, stepper):
        """Find the rows that are there. Collective."""
        self._last = self.history.take_up(stepper.step)
        return [f"{self.history.path}: is not there any more: it begins anew at step {stepper.step}"] if self._last is None else []

    def resume(self, stepper):
        """Go on behind the rows that are there; gauges look at the present state. Collective."""
        self.history.resume()
        stepper.view.prepare()
        for gauge in self.gauges:
            gauge.read(stepper)
        if self._last is None:
            self.observe(stepper)

    def state(self):
        """Return {key: Entry} of the history and of the gauges."""
        return {key: entry for each in (self.history, *self.gauges) for key, entry in getattr(each, "state", dict)().items()}

    def observe(self, stepper):
        """Append a row. Collective."""
        stepper.view.prepare()
        row = {"time [s]": stepper.time, "step": stepper.step}
        for gauge in self.gauges:
            row.update(zip(gauge.columns, gauge.read(stepper)))
        self.history.append(row)
        self._last = stepper.step

    def finish(self, stepper):
        """Append the row of the final state unless it is there. Collective."""
        if self._last != stepper.step:
            self.observe(stepper)


def columns(gauges):
    """Return the columns of history.csv: time, step and those of the gauges."""
    return ["time [s]", "step"] + [column for gauge in gauges for column in gauge.columns]


def steps_of(times, dt, n_steps):
    """Return the sorted steps nearest to `times`, within 1..n_steps."""
    return sorted(set(int(step) for step in np.clip(np.rint(np.asarray(times, float) / dt), 1, n_steps)))
