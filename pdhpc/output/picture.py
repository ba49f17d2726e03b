"""Pictures of a run, drawn from its output files alone.

Fields of 2D bodies are rasterised into pixels of about a particle's size or larger, chunk by chunk, so that memory is bounded by the picture; 3D bodies are
shown as the largest value along each of the three axes.
"""
from pathlib import Path

import numpy as np

from pdhpc.output.enrichment_picture import draw_enrichment
from pdhpc.output.fields import frame_times
from pdhpc.output.figure import INK, PAPER, dress, figure_of, length_unit, planes_of, rounded, save, time_text, title_of
from pdhpc.output.history import read_history
from pdhpc.output.mesh_picture import draw_mesh

_CHUNK = 1 << 20
_LONGEST_SIDE = 1600  # pixels


def draw(directory, curves=()):
    """Draw every picture that the outputs in `directory` hold data for; return their paths. Local.

    curves : [(name, x column, y column)] of history.csv.
    """
    import matplotlib

    matplotlib.use("Agg")
    directory, drawn = Path(directory), []
    if (directory / "fields.h5").exists() and frame_times(directory):
        drawn += draw_mesh(directory) if _has_cells(directory) else _draw_fields(directory)
    if (directory / "history.csv").exists():
        drawn += _draw_history(directory, curves)
    enrichment = draw_enrichment(directory)
    return drawn if enrichment is None else [*drawn, enrichment]


def _has_cells(directory):
    """Whether a run's fields stand on a mesh."""
    import h5py

    with h5py.File(directory / "fields" / "points.h5", "r") as file:
        return "cells" in file


def _draw_fields(directory):
    """Draw damage, displacement and the deformed shape of the last frame."""
    body, frame = _Body(directory), _Frame(directory)
    drawn = []
    if "damage" in frame.names:
        drawn.append(_draw_damage(directory, body, frame))
    if "displacement" in frame.names:
        drawn.append(_draw_map(directory / "displacement.png", body, frame, "displacement", "displacement magnitude [m]", "viridis"))
        drawn.append(_draw_deformed(directory, body, frame))
    return drawn


class _Body:
    """Particles of a run: where they are, read in chunks."""

    def __init__(self, directory):
        import h5py

        self.path = Path(directory) / "fields" / "points.h5"
        with h5py.File(self.path, "r") as file:
            self.count, self.dim = len(file["id"]), int(file.attrs["dim"])
            lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
            for first in range(0, self.count, _CHUNK):
                points = file["position"][first : first + _CHUNK]
                lower, upper = np.minimum(lower, points.min(axis=0)), np.maximum(upper, points.max(axis=0))
        self.lower, self.upper = lower[: self.dim], upper[: self.dim]
        self.spacing = self._spacing()

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


class _Frame:
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


def _raster(body, frame, name, axes, scale=0.0):
    """Return the largest value per pixel of |field| in the plane of two axes, NaN where there is no particle; positions moved by scale times u."""
    low, high = body.lower[list(axes)] - body.spacing / 2, body.upper[list(axes)] + body.spacing / 2
    if scale:
        low, high = _deformed_bounds(body, frame, axes, scale)
    pixel = max(body.spacing, float(np.max(high - low)) / _LONGEST_SIDE)
    shape = np.maximum(1, np.ceil((high - low) / pixel - 1e-6)).astype(int)
    image = np.full(shape[0] * shape[1], -np.inf)
    shifts = frame.chunks(body, "displacement") if scale else None
    for points, values in frame.chunks(body, name):
        size = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        if scale:
            points = points + scale * next(shifts)[1][:, : body.dim]
        cell = np.clip(((points[:, list(axes)] - low) / pixel).astype(int), 0, shape - 1)
        np.maximum.at(image, cell[:, 0] * shape[1] + cell[:, 1], size)
    image = image.reshape(shape)
    image[np.isneginf(image)] = np.nan
    return image.T, (low[0], low[0] + shape[0] * pixel, low[1], low[1] + shape[1] * pixel)


def _deformed_bounds(body, frame, axes, scale):
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for points, u in frame.chunks(body, "displacement"):
        moved = (points + scale * u[:, : body.dim])[:, list(axes)]
        low, high = np.minimum(low, moved.min(axis=0)), np.maximum(high, moved.max(axis=0))
    return low - body.spacing, high + body.spacing


def _draw_damage(directory, body, frame):
    """Draw the damage grown in the run, the pre-crack on top of it."""
    import matplotlib
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("crack", ["#e9edf0", "#c3d3dc", "#7fa3b8", "#f2b134", "#d9480f", "#7a0c0c"])
    colours.set_bad(PAPER, 0.0)
    planes = planes_of(body)
    figure, all_axes = figure_of(body, planes)
    unit, factor = length_unit(body)
    for axes, plane in zip(all_axes, planes):
        image, extent = _raster(body, frame, "damage", plane)
        extent = [factor * x for x in extent]
        shown = axes.imshow(image, origin="lower", extent=extent, cmap=colours, vmin=0.0, vmax=max(0.6, _largest(image)), interpolation="nearest")
        if "precrack" in frame.names:
            cut, _ = _raster(body, frame, "precrack", plane)
            overlay = np.zeros(cut.shape + (4,))
            overlay[np.nan_to_num(cut) > 0.25] = matplotlib.colors.to_rgba(INK)
            axes.imshow(overlay, origin="lower", extent=extent, interpolation="nearest")
        dress(axes, plane, unit)
    figure.colorbar(shown, ax=list(all_axes), label="damage", shrink=0.85, pad=0.015, aspect=24)
    title = f"{title_of(directory)}   t = {time_text(frame.time)}"
    if "precrack" in frame.names:
        title += "   (black: pre-crack)"
    figure.suptitle(title, fontsize=12, color=INK)
    return save(figure, directory / "damage.png")


def _draw_map(path, body, frame, name, label, colours):
    """Draw the magnitude of a field."""
    planes = planes_of(body)
    figure, all_axes = figure_of(body, planes)
    unit, factor = length_unit(body)
    for axes, plane in zip(all_axes, planes):
        image, extent = _raster(body, frame, name, plane)
        shown = axes.imshow(image, origin="lower", extent=[factor * x for x in extent], cmap=colours, interpolation="nearest")
        dress(axes, plane, unit)
    figure.colorbar(shown, ax=list(all_axes), label=label, shrink=0.85, pad=0.015, aspect=24)
    figure.suptitle(f"{title_of(path.parent)}   t = {time_text(frame.time)}", fontsize=12, color=INK)
    return save(figure, path)


def _draw_deformed(directory, body, frame):
    """Draw the deformed shape, displacements scaled so that the largest is 3 % of the body."""
    largest = max((float(np.max(np.linalg.norm(u, axis=1), initial=0.0)) for _, u in frame.chunks(body, "displacement")), default=0.0)
    size = float(np.max(body.upper - body.lower))
    scale = rounded(0.03 * size / largest) if largest > 0 and size > 0 and np.isfinite(largest) else 1.0
    scale = 1.0 if largest > 0.03 * size else scale
    name = "damage" if "damage" in frame.names else "displacement"
    planes = planes_of(body)
    figure, all_axes = figure_of(body, planes)
    unit, factor = length_unit(body)
    for axes, plane in zip(all_axes, planes):
        image, extent = _raster(body, frame, name, plane, scale)
        shown = axes.imshow(image, origin="lower", extent=[factor * x for x in extent], cmap="cividis", interpolation="nearest")
        dress(axes, plane, unit)
    figure.colorbar(shown, ax=list(all_axes), label=name if name == "damage" else "displacement magnitude [m]", shrink=0.85, pad=0.015, aspect=24)
    figure.suptitle(f"{title_of(directory)}   displacements x {scale:g}   t = {time_text(frame.time)}", fontsize=12, color=INK)
    return save(figure, directory / "deformed.png")


def _draw_history(directory, curves):
    """Draw energies, tips and curves of history.csv."""
    history = read_history(directory / "history.csv")
    drawn = []
    time = history.get("time [s]", np.empty(0)) * 1e6
    energies = [name for name in history if name.endswith("energy [J]") or name in ("external_work [J]", "balance_error [J]")]
    if energies and len(time) > 1:
        drawn.append(_draw_lines(directory, "energies", "energy [J]", time, {name[:-4].replace("_", " "): history[name] for name in energies}))
    for name in [name[: -len(".speed [m/s]")] for name in history if name.endswith(".speed [m/s]")]:
        if len(time) > 1:
            drawn.append(_draw_tip(directory, time, name, history))
    for name, x, y in curves:
        drawn.append(_draw_curve(directory, name, x, y, history))
    return drawn


def _linesfigure(rows=1):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(rows, 1, figsize=(7.5, 3.2 * rows + 0.8), sharex=True, squeeze=False, facecolor=PAPER, constrained_layout=True)
    for each in axes[:, 0]:
        each.spines[["top", "right"]].set_visible(False)
        each.grid(alpha=0.25)
    return figure, axes[:, 0]


def _draw_lines(directory, name, label, time, lines):
    figure, (axes,) = _linesfigure()
    for line, values in lines.items():
        axes.plot(time, values, label=line, linewidth=1.6)
    axes.set(xlabel="time [µs]", ylabel=label, title=title_of(directory))
    axes.legend(frameon=False)
    return save(figure, directory / f"{name}.png")


def _draw_tip(directory, time, name, history):
    figure, (upper, lower) = _linesfigure(2)
    for column in [f"{name}.{axis} [m]" for axis in "xyz"]:
        if column in history:
            upper.plot(time, 1e3 * history[column], label=column.split(".")[1][0], linewidth=1.6)
    upper.set(ylabel="tip position [mm]", title=f"{title_of(directory)}   tip '{name}'")
    upper.legend(frameon=False)
    lower.plot(time, history[f"{name}.speed [m/s]"], color="#d9480f", linewidth=1.6)
    lower.set(xlabel="time [µs]", ylabel="tip speed [m/s]")
    return save(figure, directory / f"tip_{name}.png")


def _draw_curve(directory, name, x, y, history):
    figure, (axes,) = _linesfigure()
    axes.plot(history[x], history[y], linewidth=1.6, color=INK)
    axes.set(xlabel=x, ylabel=y, title=f"{title_of(directory)}   {name}")
    return save(figure, directory / f"curve_{name}.png")


def _largest(image):
    return float(np.nanmax(image)) if np.isfinite(image).any() else 0.0


