"""run.log: what ran, where, on what, and what happened when; a line each. A run that goes on writes behind what is there.

    2026-11-26 22:31:04  INFO      checkpoint of step 120, 0.15 s

Whoever has something to say says it to LOG, on any rank; lines of rank 0 are kept, and of other ranks what ends the job (CRITICAL).
"""
import contextlib
import logging
import sys
from pathlib import Path

from pdhpc.output.record import OutputError
from pdhpc.parallel.comm import on_root

NAME = "run.log"
LOG = logging.getLogger("pdhpc")
LOG.addHandler(logging.NullHandler())  # or warnings would go to standard error where nobody keeps a log
_LINE = logging.Formatter("%(asctime)s  %(levelname)-8s  %(message)s", "%Y-%m-%d %H:%M:%S")


class RunLog:
    """The log of one run, from its making to `close`."""

    def __init__(self, comm, directory):
        """Open DIR/run.log on rank 0; other ranks would open it when they have to.

        Raises
        ------
        OutputError: it cannot be written. Collective.
        """
        path = Path(directory) / NAME
        on_root(comm, _touch, path)
        self._handler = _LogFile(path, mode="a", encoding="utf-8", delay=True)
        self._handler.setFormatter(_LINE)
        self._handler.setLevel(logging.INFO if comm.rank == 0 else logging.CRITICAL)
        self._before = LOG.level
        LOG.setLevel(min(logging.INFO, self._before or logging.INFO))
        LOG.addHandler(self._handler)

    def warnings(self):
        """Return a sentence if lines were lost."""
        return [f"{self._handler.baseFilename}: lines are missing ({self._handler.lost})"] if self._handler.lost else []

    def close(self):
        """Take no more lines. Local."""
        LOG.removeHandler(self._handler)
        LOG.setLevel(self._before)
        self._handler.close()


class _LogFile(logging.FileHandler):
    """A file whose lines may be lost where the disk is full: what computes does not stop for them."""

    lost = None

    def emit(self, record):
        try:
            super().emit(record)
        except OSError:  # it cannot be opened
            self.handleError(record)

    def handleError(self, record):
        self.lost = getattr(sys.exc_info()[1], "strerror", None) or str(sys.exc_info()[1])
        stream, self.stream = self.stream, None
        with contextlib.suppress(OSError):  # it would try to write the line again
            if stream is not None:
                stream.close()


def show_log():
    """Print lines of the log as they come, on this rank. Local."""
    handler = logging.StreamHandler(sys.stdout)
    handler.setFormatter(_LINE)
    LOG.addHandler(handler)
    LOG.setLevel(logging.DEBUG)


def _touch(path):
    try:
        with open(path, "a"):
            pass
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
