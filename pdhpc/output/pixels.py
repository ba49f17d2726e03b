"""Fields of particles as pixels of about a particle's size or larger, chunk by chunk, so that memory is bounded by the picture."""
import json
from pathlib import Path

import numpy as np

from pdhpc.output.fields import frame_times
from pdhpc.output.figure import INK, crack_colours

PRECRACK_WORDS = "   (black: pre-crack)"
_CHUNK = 1 << 20
_LONGEST_SIDE = 1600  # pixels
_COVER = 1.4  # times the side of a particle's square: how large it is drawn off a lattice, where squares leave gaps
_ON_LINES = 0.6  # of that of the smallest particle: lattice lines that are nearer than that are none
CUT = 0.25  # share of bonds that a pre-crack cut, above which a particle is drawn black


class Body:
    """Particles of a run: where they are, read in chunks.

    spacing : of the lattice lines, or, where particles lie on no common lattice, the smallest of their sides, see side_chunks, m. on_lattice : which of both.
    """

    def __init__(self, directory):
        import h5py

        self.path = Path(directory) / "fields" / "points.h5"
        with h5py.File(self.path, "r") as file:
            self.count, self.dim = len(file["id"]), int(file.attrs["dim"])
            lower, upper, least = np.full(3, np.inf), np.full(3, -np.inf), np.inf
            for first in range(0, self.count, _CHUNK):
                points = file["position"][first : first + _CHUNK]
                lower, upper = np.minimum(lower, points.min(axis=0)), np.maximum(upper, points.max(axis=0))
                least = min(least, float(file["volume"][first : first + _CHUNK].min(initial=np.inf)))
        self.lower, self.upper, self._thickness = lower[: self.dim], upper[: self.dim], _thickness(directory) if self.dim == 2 else 1.0
        self.spacing, smallest = self._spacing(), _COVER * (least / self._thickness) ** (1 / self.dim)
        self.on_lattice = not self.spacing < _ON_LINES * smallest
        if not self.on_lattice:
            self.spacing = smallest

    def side_chunks(self):
        """Yield (n,) sides of squares that cover the body, m, in proportion to the particles' sizes; None for each chunk of particles on a lattice."""
        import h5py

        with h5py.File(self.path, "r") as file:
            for first in range(0, self.count, _CHUNK):
                yield None if self.on_lattice else _COVER * (file["volume"][first : first + _CHUNK] / self._thickness) ** (1 / self.dim)

    def _spacing(self):
        """Return the smallest distance of lattice lines along the axes, from one chunk."""
        import h5py

        with h5py.File(self.path, "r") as file:
            points = file["position"][: min(self.count, 200_000)]
        gaps = []
        for axis in range(self.dim):
            lines = np.unique(np.round(points[:, axis], 12))
            if len(lines) > 1:
                gaps.append(np.min(np.diff(lines)[np.diff(lines) > 1e-9 * (np.ptp(lines) + 1e-300)], initial=np.inf))
        gaps = [gap for gap in gaps if np.isfinite(gap)]
        return min(gaps) if gaps else 1.0


def _thickness(directory):
    """Return the thickness of a plane body as the record of a run tells it, m; without a record infinity, which takes particles for a lattice's."""
    try:
        tables = json.loads((Path(directory) / "run.json").read_text())["scene"]
    except (OSError, ValueError, KeyError):
        return np.inf
    return next((tables[name]["thickness"] for name in ("mesh", "particles") if "thickness" in tables.get(name, {})), 1.0)


class Frame:
    """One frame of a run, read in chunks."""

    def __init__(self, directory, index=-1):
        import h5py

        name, self.step, self.time = frame_times(directory)[index]
        self.path = Path(directory) / "fields" / f"frame_{name}.h5"
        with h5py.File(self.path, "r") as file:
            self.names = list(file.keys())

    def chunks(self, body, name):
        """Yield (positions, values) with vectors as they are."""
        import h5py

        with h5py.File(body.path, "r") as points, h5py.File(self.path, "r") as file:
            for first in range(0, body.count, _CHUNK):
                yield points["position"][first : first + _CHUNK, : body.dim], file[name][first : first + _CHUNK]


def pixels_of(body, frame, name, axes, scale=0.0):
    """Return the largest value per pixel of |field| in the plane of two axes, NaN where there is no particle; positions moved by scale times u.

    On a lattice a particle marks the pixel it lies in, elsewhere those of its square.
    """
    low, high = body.lower[list(axes)] - body.spacing / 2, body.upper[list(axes)] + body.spacing / 2
    if scale:
        low, high = _deformed_bounds(body, frame, axes, scale)
    pixel = max(body.spacing, float(np.max(high - low)) / _LONGEST_SIDE)
    shape = np.maximum(1, np.ceil((high - low) / pixel - 1e-6)).astype(int)
    image = np.full(shape[0] * shape[1], -np.inf)
    shifts = frame.chunks(body, "displacement") if scale else None
    sides = body.side_chunks()
    for points, values in frame.chunks(body, name):
        size = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        if scale:
            points = points + scale * next(shifts)[1][:, : body.dim]
        side = next(sides)
        if side is None:
            cell = np.clip(((points[:, list(axes)] - low) / pixel).astype(int), 0, shape - 1)
            np.maximum.at(image, cell[:, 0] * shape[1] + cell[:, 1], size)
        else:
            _paint(image.reshape(shape), (points[:, list(axes)] - low) / pixel, 0.5 * side / pixel, size)
    image = image.reshape(shape)
    image[np.isneginf(image)] = np.nan
    return image.T, (low[0], low[0] + shape[0] * pixel, low[1], low[1] + shape[1] * pixel)


def _paint(image, centres, half, values):
    """Raise the pixels whose squares begin within `half` (n,) pixels of centres (n, 2), in pixels, to values (n,)."""
    first, last = np.floor(centres - half[:, None] + 0.5).astype(int), np.floor(centres + half[:, None] + 0.5).astype(int)
    last = np.maximum(last, first + 1)
    for a in range(int((last - first)[:, 0].max(initial=0))):
        for b in range(int((last - first)[:, 1].max(initial=0))):
            x, y = first[:, 0] + a, first[:, 1] + b
            inside = (x < last[:, 0]) & (y < last[:, 1]) & (x >= 0) & (y >= 0) & (x < image.shape[0]) & (y < image.shape[1])
            np.maximum.at(image, (x[inside], y[inside]), values[inside])


def _deformed_bounds(body, frame, axes, scale):
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for points, u in frame.chunks(body, "displacement"):
        moved = (points + scale * u[:, : body.dim])[:, list(axes)]
        low, high = np.minimum(low, moved.min(axis=0)), np.maximum(high, moved.max(axis=0))
    return low - body.spacing, high + body.spacing


def show_damage(axes, body, frame, plane, factor, least=None):
    """Draw the damage grown in the run, the pre-crack on top of it, lengths times `factor`; return the image.

    least : None, or the damage below which nothing is drawn, so that what lies beneath is seen.
    """
    from matplotlib.colors import to_rgba

    image, extent = pixels_of(body, frame, "damage", plane)
    extent = [factor * x for x in extent]
    largest = float(np.nanmax(image)) if np.isfinite(image).any() else 0.0
    colours = crack_colours(least is None)
    image = image if least is None else np.where(image < least, np.nan, image)
    shown = axes.imshow(image, origin="lower", extent=extent, cmap=colours, vmin=0.0, vmax=max(0.6, largest), interpolation="nearest")
    if "precrack" in frame.names:
        cut, _ = pixels_of(body, frame, "precrack", plane)
        overlay = np.zeros(cut.shape + (4,))
        overlay[np.nan_to_num(cut) > CUT] = to_rgba(INK)
        axes.imshow(overlay, origin="lower", extent=extent, interpolation="nearest")
    return shown
