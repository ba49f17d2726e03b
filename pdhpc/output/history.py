"""history.csv: one row per time, one column per quantity, units in the header."""
import csv
import io
import math
import zlib
from pathlib import Path

import numpy as np

from pdhpc.output.record import OutputError, refusal, write_text
from pdhpc.parallel.comm import on_root
from pdhpc.state import number


class History:
    """Appends rows to history.csv, each as one line handed to the system at once; rank 0 writes."""

    def __init__(self, path, columns, comm):
        """columns: names with units, such as "time [s]". Local: the file is made by `begin` or taken up by `resume`."""
        self.path, self.columns, self.comm = Path(path), list(columns), comm
        self.rows, self.crc, self._kept = 0, 0, None  # written so far, known on rank 0

    def state(self):
        """Return {key: Entry} of what tells whether the rows that a restart finds are those that the run wrote: their number and CRC-32."""
        return {"history/rows": number(self, "rows", int), "history/crc": number(self, "crc", int)}

    def begin(self):
        """Write the header, and nothing else. Collective."""
        self.rows, self.crc = 0, 0
        on_root(self.comm, self._write, "w", _text([self.columns]))

    def take_up(self, step):
        """Read the rows up to a step, which `resume` keeps; return the last step, -1 without a row, None without a file. Collective.

        Raises
        ------
        OutputError: the file cannot be read, or has other columns; exit_code 2.
        """
        return on_root(self.comm, self._read, step)

    def resume(self):
        """Leave in the file the rows that `take_up` read. Collective."""
        on_root(self.comm, self._keep)

    def _read(self, step):
        if not self.path.exists():
            self._kept, self.rows, self.crc = [], 0, 0
            return None
        try:
            with open(self.path, newline="", encoding="utf-8") as file:
                rows = list(csv.reader(file.read().split("\n")[:-1]))
            if not rows or rows[0] != self.columns:
                raise ValueError("its columns are not those of this run")
            place = self.columns.index("step")
            if not all(row[place].isdigit() for row in rows[1:] if len(row) == len(self.columns)):
                raise ValueError("a row without a step")
            self._kept = [row for row in rows[1:] if len(row) == len(self.columns) and int(row[place]) <= step]
            if (len(self._kept), zlib.crc32(_text(self._kept).encode())) != (self.rows, self.crc):
                raise ValueError(f"its {len(self._kept)} rows up to step {step} are not the {self.rows} that the run wrote")
        except (OSError, ValueError, csv.Error) as error:
            raise refusal(f"{self.path}: cannot be continued ({getattr(error, 'strerror', None) or error}); allowed is the history as the run left it, or none") from error
        return int(self._kept[-1][place]) if self._kept else -1

    def _keep(self):
        write_text(self.path, _text([self.columns, *self._kept]))
        self._kept = None

    def append(self, row):
        """Append {column: value}; numbers keep every digit. Collective."""
        on_root(self.comm, self._append, row)

    def _append(self, row):
        line = _text([[_number(row[column]) for column in self.columns]])
        self._write("a", line)
        self.rows, self.crc = self.rows + 1, zlib.crc32(line.encode(), self.crc)

    def _write(self, mode, text):
        try:
            with open(self.path, mode, newline="", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror})") from error


def _text(rows):
    """Return rows of cells as the file has them."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _number(value):
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    return repr(float(value)) if math.isfinite(value) else "nan" if math.isnan(value) else str(float(value))


def read_history(path):
    """Return {column: (n,) float array} of a history.csv; a torn last line is left out."""
    with open(path, newline="", encoding="utf-8") as file:
        lines = file.read().split("\n")[:-1]
    rows = list(csv.reader(lines))
    columns = rows[0] if rows else []
    values = np.array([row for row in rows[1:] if len(row) == len(columns)], dtype=float).reshape(-1, len(columns))
    return {column: values[:, number] for number, column in enumerate(columns)}
