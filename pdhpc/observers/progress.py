"""Progress: a bar on a terminal, plain lines in a batch job's output and in the log; rank 0 only."""
import os
import sys
import time

from pdhpc.output.log import LOG
from pdhpc.run import Observer

_LINES = 10


class Progress(Observer):
    """Show step, time and rate. Local: nothing is sent."""

    def __init__(self, n_steps, quiet=False):
        self.n_steps, self.quiet = n_steps, quiet
        self.every = max(1, n_steps // 200)
        self._bar = self._task = None
        self._terminal = _on_terminal()
        self._started, self._first = None, 0

    def start(self, stepper):
        """Open the bar."""
        self._started, self._first = time.perf_counter(), stepper.step
        if self._terminal and not self.quiet:
            from rich.console import Console
            from rich.progress import BarColumn, Progress as Bar, TextColumn, TimeRemainingColumn

            self._bar = Bar(TextColumn("step {task.completed}/{task.total}"), BarColumn(None), TextColumn("{task.fields[at]}"), TimeRemainingColumn(),
                            console=Console(force_terminal=True))
            self._bar.start()
            self._task = self._bar.add_task("", total=self.n_steps, at="")

    def resume(self, stepper):
        """As `start`."""
        self.start(stepper)

    def observe(self, stepper):
        """Move the bar, or print a line every tenth of the run; every time where a stepper has something to say of its last step."""
        if self._bar:
            self._bar.update(self._task, completed=stepper.step, at=f"t = {stepper.time:.3e} s{self._note(stepper)}")
        if self._note(stepper) or stepper.step * _LINES // self.n_steps > (stepper.step - self.every) * _LINES // self.n_steps:
            elapsed = time.perf_counter() - self._started
            rate = (stepper.step - self._first) / elapsed
            line = f"step {stepper.step}/{self.n_steps}  t = {stepper.time:.4e} s  {elapsed:.1f} s elapsed  {rate:.1f} steps/s{self._note(stepper)}"
            LOG.info(line)
            if not (self._bar or self.quiet):
                print(line, flush=True)

    def _note(self, stepper):
        """Return what the stepper says of its last step, if it says anything."""
        note = getattr(stepper, "note", "")
        return f"  {note}" if note else ""

    def close(self):
        """Take the bar down, also after a failure."""
        if self._bar:
            self._bar.stop()
            self._bar = None

    def finish(self, stepper):
        """Fill and close the bar."""
        if self._bar:
            self._bar.update(self._task, completed=stepper.step)
        self.close()


def _on_terminal():
    """Whether somebody watches standard output. Under Open MPI it is a pseudo-terminal even in a batch job, so mpirun's own output is looked at."""
    if "OMPI_COMM_WORLD_SIZE" not in os.environ:
        return sys.stdout.isatty()
    try:
        return os.readlink(f"/proc/{os.getppid()}/fd/1").startswith(("/dev/pts", "/dev/tty"))
    except OSError:
        return False
