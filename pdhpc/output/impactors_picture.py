"""Rigid impactors in pictures: where a frame had them, their outlines in maps, and what a camera sees of them."""
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.output.figure import INK
from pdhpc.output.history import read_history
from pdhpc.output.rendering import light_of

_GLASS = np.array([0.42, 0.58, 0.78])
_OPAQUE = 0.6  # of a ball in front of a body, so that what it struck is seen
_EDGE = 0.9  # of its outline
_CORNERS = 96  # points of a circle


class Rigid(NamedTuple):
    """An impactor: shape "sphere", "cylinder" or "plane"; place, start (3,), m, in the frame and at first; axis (3,), of a cylinder, or the normal of a plane, unit;
    radius, half_length (of a cylinder, infinite without ends), m. z = 0 in 2D, where cylinders are disks across the plane."""

    shape: str
    place: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    radius: float
    half_length: float

    @property
    def bounded(self):
        """Whether it fits into a picture."""
        return self.shape == "sphere" or self.shape == "cylinder" and np.isfinite(self.half_length)

    def moved(self, scale):
        """Return it with its way since the start times `scale`."""
        return self._replace(place=self.start + scale * (self.place - self.start))


def read_impactors(directory, step):
    """Return the Rigid ones of a run at a step, from its record and its history; none where these do not tell. Local."""
    directory = Path(directory)
    try:
        tables = json.loads((directory / "run.json").read_text())["scene"].get("impactor", [])
        history = read_history(directory / "history.csv") if tables else {}
    except (OSError, ValueError, KeyError):
        return []
    row = np.flatnonzero(history.get("step", np.empty(0)) == step)
    return [_rigid(table, history, row[0]) for table in tables if len(row) and f"{table['name']}.position_x [m]" in history]


def _rigid(table, history, row):
    place, start, axis = np.zeros(3), np.zeros(3), np.zeros(3)
    given = table.get("center", table.get("point"))
    start[: len(given)] = given
    place[: len(given)] = [history[f"{table['name']}.position_{x} [m]"][row] for x in "xyz"[: len(given)]]
    direction = table.get("normal") or table.get("axis") or ([0.0, 0.0, 1.0] if table["shape"] == "cylinder" else [0.0])
    axis[: len(direction)] = np.asarray(direction) / max(np.linalg.norm(direction), 1e-300)
    length = table.get("length") or (np.inf if len(given) == 3 else 0.0)
    return Rigid(table["shape"], place, start, axis, table.get("radius", 0.0), 0.5 * length)


def _across(axis):
    """Return two unit vectors (3,) at right angles to an axis and to each other."""
    one = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    one /= np.linalg.norm(one)
    return one, np.cross(axis, one)


def outline(rigid, plane, far):
    """Return (n, 2), m, the closed outline of an impactor along the third axis, or the two ends of a line; None of a plane that is not seen edge on.

    plane : two axes. far : m, beyond which nothing is shown.
    """
    angle = np.linspace(0.0, 2 * np.pi, _CORNERS, endpoint=False)
    circle, axes = rigid.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), list(plane)
    if rigid.shape == "sphere":
        return rigid.place[axes] + circle
    if rigid.shape == "plane":
        normal = rigid.axis[axes]
        if np.linalg.norm(normal) < 1.0 - 1e-9:
            return None
        return rigid.place[axes] + far * np.array([[-normal[1], normal[0]], [normal[1], -normal[0]]])
    from scipy.spatial import ConvexHull

    end = min(rigid.half_length, far) * rigid.axis
    ring = circle @ np.stack(_across(rigid.axis))
    points = (rigid.place + np.concatenate([ring - end, ring + end]))[:, axes]
    return points[ConvexHull(points).vertices]


def draw_outlines(axes, rigids, plane, factor):
    """Draw the outlines of impactors over a map whose lengths are times `factor`; widen the map for those that it would cut off, at most by its half on each side."""
    low, high = (np.sort(limits) for limits in (axes.get_xlim(), axes.get_ylim()))
    low, high = np.array([low[0], high[0]]), np.array([low[1], high[1]])
    least, most, far = low - 0.5 * (high - low).max(), high + 0.5 * (high - low).max(), 10.0 * float((high - low).max()) / factor
    for rigid in rigids:
        points = outline(rigid, plane, far)
        if points is None:
            continue
        points = factor * np.concatenate([points, points[:1]])
        axes.plot(points[:, 0], points[:, 1], color=INK, linewidth=1.3, zorder=5)
        if rigid.bounded:
            low, high = np.minimum(low, np.maximum(points.min(axis=0), least)), np.maximum(high, np.minimum(points.max(axis=0), most))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def reach_of(rigid, camera):
    """Return (low, high), (2,) m: the frame around an impactor that fits into a picture."""
    middle, size = np.array([rigid.place @ camera.right, rigid.place @ camera.up]), np.full(2, rigid.radius)
    if rigid.shape == "cylinder":
        along = rigid.half_length * np.array([abs(rigid.axis @ camera.right), abs(rigid.axis @ camera.up)])
        size = along + rigid.radius * np.sqrt(np.maximum(0.0, 1.0 - np.array([rigid.axis @ camera.right, rigid.axis @ camera.up]) ** 2))
    return middle - size, middle + size


def front(rigid, canvas, kept=None):
    """Return (rows, columns), m: the depth of an impactor's surface in a Canvas, -inf where it is not seen.

    kept : None, or (normal (3,), m): only the half space normal . x >= m of it. A plane seen from behind is not seen.
    """
    camera, (rows, columns) = canvas.camera, canvas.depth.shape
    x = canvas.low[0] + (np.arange(columns) + 0.5) * canvas.pixel
    y = canvas.low[1] + (np.arange(rows) + 0.5) * canvas.pixel
    origin = x[None, :, None] * camera.right + y[:, None, None] * camera.up - rigid.place
    near, far = np.full((rows, columns), np.inf), np.full((rows, columns), -np.inf)  # the stretch of each ray within: far <= t <= near
    if rigid.shape == "sphere":
        near, far = _round(origin, camera.toward, rigid.radius)
    elif rigid.shape == "plane":
        near, far = _half_space(origin, camera.toward, -rigid.axis, 0.0, near, far)
    else:
        flat, toward = (v - (v @ rigid.axis)[..., None] * rigid.axis for v in (origin, camera.toward))
        near, far = _round(flat, toward, rigid.radius)
        if np.isfinite(rigid.half_length):
            for side in (rigid.axis, -rigid.axis):
                near, far = _half_space(origin, camera.toward, side, -rigid.half_length, near, far)
    if kept is not None:
        near, far = _half_space(origin, camera.toward, kept[0], kept[1] - kept[0] @ rigid.place, near, far)
    return np.where((near >= far) & np.isfinite(near), near, -np.inf)


def _round(origin, toward, radius):
    """Return (near, far) of rays origin + t toward within |x| <= radius."""
    a, b, c = toward @ toward, origin @ toward, (origin**2).sum(axis=-1) - radius**2
    if a < 1e-24:  # along the axis of a cylinder: inside it or not
        return np.where(c <= 0.0, np.inf, -np.inf), np.where(c <= 0.0, -np.inf, np.inf)
    root = np.sqrt(np.maximum(0.0, b * b - a * c))
    hit = b * b >= a * c
    return np.where(hit, (root - b) / a, -np.inf), np.where(hit, (-root - b) / a, np.inf)


def _half_space(origin, toward, normal, least, near, far):
    """Return (near, far) of what is left of rays where normal . x >= least."""
    at, slope = origin @ normal - least, float(toward @ normal)
    if abs(slope) < 1e-12:
        return np.where(at >= 0.0, near, -np.inf), np.where(at >= 0.0, far, np.inf)
    return (near, np.maximum(far, -at / slope)) if slope > 0.0 else (np.minimum(near, -at / slope), far)


def tint(image, canvas, rigids, kept=None):
    """Lay impactors over an image (rows, columns, 3) of a Canvas, as of coloured glass, where they are in front of the body; shaded, with an outline."""
    for rigid in rigids:
        depth = front(rigid, canvas, kept)
        covered = np.isfinite(depth)
        inner = covered.copy()
        inner[1:-1, 1:-1] &= covered[:-2, 1:-1] & covered[2:, 1:-1] & covered[1:-1, :-2] & covered[1:-1, 2:]
        seen = covered & (depth > canvas.depth)
        share = np.where(inner, _OPAQUE, _EDGE)[seen][:, None]
        image[seen] = (1.0 - share) * image[seen] + share * np.where(inner, light_of(depth, canvas.pixel), 0.4)[seen][:, None] * _GLASS
    return image
