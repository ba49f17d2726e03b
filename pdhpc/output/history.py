"""history.csv: one row per time, one column per quantity, units in the header."""
import csv
import math
from pathlib import Path

import numpy as np

from pdhpc.output.record import OutputError
from pdhpc.parallel.comm import on_root


class History:
    """Appends rows to history.csv, each as one line handed to the system at once; rank 0 writes."""

    def __init__(self, path, columns, comm):
        """columns: names with units, such as "time [s]". Collective."""
        self.path, self.columns, self.comm = Path(path), list(columns), comm
        on_root(comm, self._write, "w", self.columns)

    def append(self, row):
        """Append {column: value}; numbers keep every digit. Collective."""
        on_root(self.comm, self._write, "a", [_number(row[column]) for column in self.columns])

    def _write(self, mode, cells):
        try:
            with open(self.path, mode, newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerow(cells)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror})") from error


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
