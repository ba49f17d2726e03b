"""The fracture of a 3D body: its surface, a cut through it, and what is damaged, seen from one side."""
from pathlib import Path
from typing import NamedTuple, Optional, Tuple

import numpy as np

from pdhpc.output.figure import INK, PAPER, crack_colours, save, time_text, title_of
from pdhpc.output.impactors_picture import reach_of, read_impactors, tint
from pdhpc.output.pixels import CUT, Body, Frame
from pdhpc.output.rendering import Camera, Canvas

_LONGEST_SIDE = 900  # pixels of a view
_RADIUS = 0.71  # of a particle's size: balls on a cubic lattice leave no gap
_FARTHEST = 0.5  # of the body's diagonal: fragments that flew farther are outside the frame
_PRECRACKED = -1.0  # shown in ink
_GHOST = 0.22  # how dark the outline of the whole body is behind what is damaged
_CHUNK = 1 << 20


class View(NamedTuple):
    """How a run is looked at.

    frame : index of a frame, from 0, or from -1 for the last. azimuth, elevation : where the camera stands, degrees. cut : None, or (axis, m) of the plane that
    is cut along, beyond which, towards the camera, nothing is drawn; by default half way along y or x, whichever faces the camera more. above : damage from
    which a particle counts as damaged.
    """

    frame: int = -1
    azimuth: float = -60.0
    elevation: float = 30.0
    cut: Optional[Tuple[int, float]] = None
    above: float = 0.35


def draw_fracture(directory, view=View()):
    """Draw fracture.png of a run's frame; return its path, or None where the body is plane or its damage was not written. Local."""
    directory = Path(directory)
    body, frame = Body(directory), Frame(directory, view.frame)
    if body.dim != 3 or "damage" not in frame.names:
        return None
    camera = Camera.at(view.azimuth, view.elevation)
    axis, place = view.cut or _middle(camera, body)
    rigids = read_impactors(directory, frame.step)
    low, high = _frame_of(camera, body, frame, rigids)
    whole, cut, damaged = (Canvas(camera, low, high, _LONGEST_SIDE) for _ in range(3))
    kept_side = -1.0 if camera.toward[axis] > 0.0 else 1.0
    for reference, points, radius, values in _balls(body, frame):
        whole.draw(points, radius, values)
        behind = kept_side * (reference[:, axis] - place) >= 0.0
        cut.draw(points[behind], radius[behind], values[behind])
        broken = (values >= view.above) | (values == _PRECRACKED)
        damaged.draw(points[broken], radius[broken], values[broken])
    half = kept_side * np.eye(3)[axis], kept_side * place
    views = (("surface", whole, None), (f"cut at {'xyz'[axis]} = {place:.4g} m", cut, None), (f"damage from {view.above:g} on", damaged, whole))
    return _paint(directory, frame, views, {"surface": (rigids, None), views[1][0]: (rigids, half)})


def _middle(camera, body):
    """Return (axis, m): half way along the horizontal axis that faces the camera more."""
    axis = int(np.argmax(np.abs(camera.toward[:2])))
    return axis, float(body.lower[axis] + body.upper[axis]) / 2


def _frame_of(camera, body, frame, rigids):
    """Return (low, high), (2,) m, the frame of the pictures: all particles and impactors, but what is farther than half the body's diagonal."""
    room = _FARTHEST * float(np.linalg.norm(body.upper - body.lower)) + body.spacing
    farthest = camera.extent(body.lower - room, body.upper + room)
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for _, points, radius, _ in _balls(body, frame):
        flat, reach = points @ np.stack([camera.right, camera.up], axis=1), float(radius.max(initial=0.0))
        flat = flat[np.isfinite(flat).all(axis=1)]
        low, high = np.minimum(low, flat.min(axis=0, initial=np.inf) - reach), np.maximum(high, flat.max(axis=0, initial=-np.inf) + reach)
    for rigid in rigids:
        if rigid.bounded:
            around = reach_of(rigid, camera)
            low, high = np.minimum(low, around[0]), np.maximum(high, around[1])
    return np.maximum(low, farthest[0]), np.minimum(high, farthest[1])


def _balls(body, frame):
    """Yield (reference places, present places (n, 3), radius (n,), damage (n,)) of particles, -1 as damage where a pre-crack cut many bonds."""
    import h5py

    with h5py.File(body.path, "r") as points, h5py.File(frame.path, "r") as file:
        for first in range(0, body.count, _CHUNK):
            piece = slice(first, first + _CHUNK)
            reference, values = points["position"][piece], np.array(file["damage"][piece])
            moved = reference + file["displacement"][piece] if "displacement" in file else reference
            if "precrack" in file:
                values[file["precrack"][piece] > CUT] = _PRECRACKED
            yield reference, moved, _RADIUS * np.cbrt(points["volume"][piece]), values


def _paint(directory, frame, views, rigids):
    """Put the views beside each other, with one colour bar; rigids : {title of a view: (impactors in it, what is kept of them)}."""
    import matplotlib.pyplot as plt

    colours = crack_colours()
    colours.set_under(INK)
    largest = max([0.6] + [float(np.nanmax(canvas.value)) for _, canvas, _ in views if np.isfinite(canvas.value).any()])
    rows, columns = views[0][1].value.shape
    height = min(8.0, max(2.2, 5.2 * rows / columns))
    figure, all_axes = plt.subplots(1, len(views), figsize=(16.5, height + 1.0), facecolor=PAPER, constrained_layout=True)
    for axes, (title, canvas, behind) in zip(all_axes, views):
        axes.imshow(tint(_colour(canvas, behind, colours, largest), canvas, *rigids.get(title, ([], None))), origin="lower", extent=canvas.extent, interpolation="nearest")
        axes.set_title(title, fontsize=11, color=INK)
        axes.set_axis_off()
    scale = plt.cm.ScalarMappable(plt.Normalize(0.0, largest), colours)
    figure.colorbar(scale, ax=list(all_axes), label="damage", shrink=0.8, pad=0.01, aspect=24)
    words = "   (black: pre-crack)" if "precrack" in frame.names else ""
    figure.suptitle(f"{title_of(directory)}   t = {time_text(frame.time)}{words}", fontsize=12, color=INK)
    return save(figure, directory / "fracture.png")


def _colour(canvas, behind, colours, largest):
    """Return (rows, columns, 3) of a canvas, over a pale one of what is behind it."""
    values = np.where(np.isnan(canvas.value), np.nan, np.where(canvas.value < 0.0, -1.0, canvas.value / largest))
    image = colours(np.ma.masked_invalid(values))[..., :3] * canvas.light()[..., None]
    empty = ~np.isfinite(canvas.depth)
    image[empty] = 1.0
    if behind is not None:
        image[empty] = (1.0 - _GHOST * (np.isfinite(behind.depth) * (1.6 - behind.light())))[empty, None]
    return image
