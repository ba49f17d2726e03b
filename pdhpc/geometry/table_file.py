"""Tables of points as text: x y [z] volume block on each line, blanks or commas between, comments from # on. On one rank."""
import warnings
from pathlib import Path

import numpy as np

_BLOCK = 1 << 22  # bytes parsed at once
_LONGEST = 1 << 16  # bytes of a line
_SHOWN = 40  # characters of a line in a sentence
_MOST_BLOCKS = 2**53


class TableFile:
    """A table, read once, piece by piece.

    Attributes
    ----------
    blocks : set of int, those met so far. count : rows read so far.
    """

    def __init__(self, path, dim):
        """dim : 2 or 3, coordinates of a row."""
        self.path, self.dim, self.blocks, self.count = Path(path), dim, set(), 0

    def pieces(self):
        """Yield (points (n, dim) m, volume (n,) m^3, block (n,) int64) of the rows, in order, in pieces of at most 4 MB of text.

        Raises
        ------
        ValueError, naming file and line: no such file, not a text, a row of other than dim + 2 numbers, numbers that are not finite, a volume that is not
        above 0, a block that is no whole number; a file without rows.
        """
        line = 1
        for text in self._texts():
            rows = self._parse(text, line)
            line += text.count("\n")
            if len(rows):
                block = rows[:, self.dim + 1].astype(np.int64)
                self.blocks.update(np.unique(block).tolist())
                self.count += len(rows)
                yield np.ascontiguousarray(rows[:, : self.dim]), rows[:, self.dim].copy(), block
        if not self.count:
            raise ValueError(f"the table {self.path} has no rows")

    def _texts(self):
        """Yield the file as texts of whole lines."""
        if not self.path.is_file():
            raise ValueError(f"there is no table {self.path}")
        line, rest = 1, b""
        try:
            with open(self.path, "rb") as file:
                while True:
                    data = file.read(_BLOCK)
                    cut = data.rfind(b"\n") + 1 if data else 0
                    whole, rest = (rest + data[:cut], data[cut:]) if data and cut else (b"", rest + data) if data else (rest, b"")
                    if len(rest) > _LONGEST:
                        raise ValueError(f"the table {self.path} has a line longer than {_LONGEST} characters")
                    if whole:
                        yield whole.decode("utf-8-sig" if line == 1 else "utf-8")
                        line += whole.count(b"\n")
                    if not data:
                        return
        except OSError as error:
            raise ValueError(f"the table {self.path} cannot be read ({error.strerror or error})") from None
        except UnicodeDecodeError:
            raise ValueError(f"the table {self.path} is not a text: after line {line} it holds bytes that are not UTF-8") from None

    def _parse(self, text, line):
        """Return the rows (n, dim + 2) of a text that starts at a line of the file."""
        lines = text.replace(",", " ").split("\n")
        width = self.dim + 2
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a text of comments alone
                rows = np.loadtxt(lines, ndmin=2)
        except ValueError:
            rows = None
        if rows is not None and rows.size == 0:
            return np.empty((0, width))
        if rows is None or rows.shape[1] != width or not self._are_right(rows).all():
            raise ValueError(f"the table {self.path} has {self._first_wrong(lines, line)}")
        return rows

    def _are_right(self, rows):
        """Return (n,) bool: rows of finite numbers with a volume above 0 and a whole block."""
        block = rows[:, -1]
        with np.errstate(invalid="ignore"):
            return np.isfinite(rows).all(axis=1) & (rows[:, -2] > 0) & (block == np.rint(block)) & (np.abs(block) < _MOST_BLOCKS)

    def _first_wrong(self, lines, first):
        """Return what is wrong with the first wrong line."""
        columns = ", ".join(["x", "y", "z"][: self.dim] + ["volume", "block"])
        for number, text in enumerate(lines, first):
            words = text.split("#", 1)[0].split()
            if not words:
                continue
            if len(words) != self.dim + 2:
                return f"{len(words)} column{'s' if len(words) != 1 else ''} in line {number}; in {self.dim}D a row has {self.dim + 2}: {columns}"
            try:
                values = np.array([float(word) for word in words])
            except ValueError:
                shown = "".join(each if each.isprintable() else "?" for each in text.strip())[:_SHOWN]
                return f"no numbers ({columns}) in line {number}: {shown}"
            if not np.isfinite(values).all():
                return f"a number that is not finite in line {number}"
            if values[-2] <= 0:
                return f"the volume {values[-2]:g} m^3 in line {number}; a volume is above 0"
            if not self._are_right(values[None])[0]:
                return f"the block {values[-1]:g} in line {number}; a block is a whole number"
        return "rows that cannot be read"
