"""Time functions f(t) that scale loads, each with its rate f'(t)."""
import math
from dataclasses import dataclass
from typing import Tuple

import numpy as np


@dataclass(frozen=True)
class Constant:
    """f = 1."""

    def value(self, t):
        """Return f(t), dimensionless."""
        return 1.0

    def rate(self, t):
        """Return f'(t), 1/s."""
        return 0.0


@dataclass(frozen=True)
class Ramp:
    """f = 0 before `start`, 1 after `end`, linear between (s)."""

    start: float
    end: float

    def value(self, t):
        """Return f(t), dimensionless."""
        return min(1.0, max(0.0, (t - self.start) / (self.end - self.start)))

    def rate(self, t):
        """Return f'(t), 1/s; at the corners the value of the side inside the ramp."""
        return 1.0 / (self.end - self.start) if self.start <= t <= self.end else 0.0


@dataclass(frozen=True)
class Sine:
    """f = sin(2 pi frequency t + phase); frequency in Hz, phase in rad."""

    frequency: float
    phase: float = 0.0

    def value(self, t):
        """Return f(t), dimensionless."""
        return math.sin(2 * math.pi * self.frequency * t + self.phase)

    def rate(self, t):
        """Return f'(t), 1/s."""
        return 2 * math.pi * self.frequency * math.cos(2 * math.pi * self.frequency * t + self.phase)


@dataclass(frozen=True)
class Table:
    """f through (times, values), linear between them and constant outside."""

    times: Tuple[float, ...]
    values: Tuple[float, ...]

    def value(self, t):
        """Return f(t), dimensionless."""
        return float(np.interp(t, self.times, self.values))

    def rate(self, t):
        """Return f'(t), 1/s; at a corner the slope that follows it."""
        index = int(np.searchsorted(self.times, t, side="right"))
        if index == 0 or index == len(self.times):
            return 0.0
        return (self.values[index] - self.values[index - 1]) / (self.times[index] - self.times[index - 1])
