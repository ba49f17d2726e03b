"""Crack tip tracking: the foremost damaged particle along a direction, and its speed."""
from collections import deque

import numpy as np

from pdhpc.run import Observer
from pdhpc.state import EVERYWHERE, Entry

_SAMPLES_PER_WINDOW = 4


class CrackTip(Observer):
    """Position of the particle farthest along `direction` whose grown damage exceeds a threshold, and its speed over the last `window` seconds.

    Sampled four times per window; the speed is the advance along `direction` over one window divided by it, 0 until a tip was there for a whole window.
    The path is the places that the samples found it at, each counted once as long as it stays there.
    """

    def __init__(self, comm, settings, members, view, dt):
        """settings: scene.Tip (name, direction, threshold, window); members (n,) particles of the View in its region; dt, s."""
        dim = view.dim
        self.comm, self.settings, self.members = comm, settings, members.astype(np.int64)
        direction = np.asarray(settings.direction or [1.0, 0.0, 0.0][:dim], float)
        self._forward = direction / np.linalg.norm(direction)
        self.ahead = view.places(self.members) @ self._forward  # of the members
        self.every = max(1, int(settings.window / dt / _SAMPLES_PER_WINDOW))
        self._span = max(1, int(round(settings.window / dt / self.every)))  # samples in a window
        self._samples = deque(maxlen=self._span + 1)
        self.dt, self.position, self.speed, self.largest_speed = dt, None, 0.0, 0.0
        axes = "xyz"[:dim]
        self.columns = tuple(f"{settings.name}.{axis} [m]" for axis in axes) + (f"{settings.name}.speed [m/s]",)
        self._dim, self._start, self._moments = dim, None, np.zeros((1 + dim, 1 + dim))  # sum over the path of (1, x)(1, x), x from its start

    def start(self, stepper):
        """Look for a tip in the initial state. Collective."""
        self.observe(stepper)

    def observe(self, stepper):
        """Find the tip. Collective."""
        found = stepper.view.foremost(self.members, self.ahead, self.settings.threshold)
        mine = (-self.ahead[found], tuple(stepper.view.places(self.members[[found]])[0])) if found >= 0 else (np.inf, None)
        ahead, position = self.comm.allreduce(mine, op=min)
        self._samples.append(-ahead if position is not None else None)
        self._follow(position)
        first, last = self._samples[0], self._samples[-1]
        whole = len(self._samples) == self._span + 1 and first is not None
        self.speed = (last - first) / (self._span * self.every * self.dt) if whole else 0.0
        self.largest_speed = max(self.largest_speed, self.speed)

    def _follow(self, position):
        """Take a position, or None, as the latest, and into the path when it is another than the last. Local."""
        if position is not None and position != self.position:
            self._start = self._start or position
            row = np.array([1.0, *np.subtract(position, self._start)])
            self._moments += row[:, None] * row
        self.position = position

    def path_direction(self):
        """Return the unit vector along the line of least squared distances to the places of the path, forward; None of fewer than two places. Local."""
        n = self._moments[0, 0]
        if n < 2:
            return None
        mean = self._moments[0, 1:] / n
        along = np.linalg.eigh(self._moments[1:, 1:] / n - mean[:, None] * mean)[1][:, -1]  # of the largest eigenvalue of the covariance
        return (along if along @ self._forward >= 0.0 else -along).tolist()

    def record(self):
        """Return {name: value} for run.json. Local."""
        return {"position": self.position, "speed": self.speed, "largest_speed": self.largest_speed, "path_direction": self.path_direction()}

    def read(self, stepper):
        """Return the values of the columns; NaN while there is no tip. Local."""
        return [*(self.position if self.position is not None else (np.nan,) * self._dim), self.speed]

    def state(self):
        """Return {key: Entry} of the samples taken."""
        return {f"tip/{self.settings.name}": Entry(self._taken, self._take, EVERYWHERE)}

    def _taken(self):
        """Return the tip, the start of its path, its speeds, moments and samples, one after the other; NaN where there was no tip."""
        places = [(np.nan,) * self._dim if place is None else place for place in (self.position, self._start)]
        samples = [np.nan if sample is None else sample for sample in self._samples]
        return np.concatenate([*places, (self.speed, self.largest_speed), self._moments.ravel(), samples])

    def _take(self, values):
        ends = np.cumsum([self._dim, self._dim, 2, self._moments.size])
        position, start, speeds, moments, samples = np.split(np.asarray(values, float), ends)
        self.position, self._start = (None if np.isnan(place).any() else tuple(place.tolist()) for place in (position, start))
        self.speed, self.largest_speed = speeds.tolist()
        self._moments[...] = moments.reshape(self._moments.shape)
        self._samples.extend(None if np.isnan(sample) else float(sample) for sample in samples)
