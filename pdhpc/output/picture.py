"""Pictures of a run, drawn from its output files alone.

Fields of particles are shown as pixels (output/pixels.py); 3D bodies as the largest value along each of the three axes, their
fracture as a camera sees it (output/fracture_picture.py).
"""
from pathlib import Path

import numpy as np

from pdhpc.output.enrichment_picture import draw_enrichment
from pdhpc.output.fields import frame_times
from pdhpc.output.figure import INK, PAPER, dress, figure_of, length_unit, planes_of, rounded, save, squares, time_axis, time_text, title_of
from pdhpc.output.fracture_picture import View, draw_fracture
from pdhpc.output.history import read_history
from pdhpc.output.impactors_picture import draw_outlines, read_impactors
from pdhpc.output.mesh_picture import draw_mesh
from pdhpc.output.patches_picture import draw_patches
from pdhpc.output.pixels import PRECRACK_WORDS, Body, Frame, pixels_of, show_damage

_MOST_SQUARES = 20_000  # particles up to which each is drawn where it is


def draw(directory, curves=(), view=View()):
    """Draw every picture that the outputs in `directory` hold data for; return their paths. Local.

    curves : [(name, x column, y column)] of history.csv. view : View, which frame is drawn and how 3D bodies are looked at.
    """
    import matplotlib

    matplotlib.use("Agg")
    directory, drawn = Path(directory), []
    if (directory / "fields.h5").exists() and frame_times(directory):
        drawn += draw_mesh(directory, view.frame) if _has_cells(directory) else _draw_fields(directory, view)
    if (directory / "history.csv").exists():
        drawn += _draw_history(directory, curves)
    return drawn + [picture for picture in (draw_patches(directory), draw_enrichment(directory)) if picture is not None]


def _has_cells(directory):
    """Whether a run's fields stand on a mesh."""
    import h5py

    with h5py.File(directory / "fields" / "points.h5", "r") as file:
        return "cells" in file


def _draw_fields(directory, view):
    """Draw damage, displacement and the deformed shape of one frame."""
    body, frame = Body(directory), Frame(directory, view.frame)
    fracture = draw_fracture(directory, view)
    drawn = [] if fracture is None else [fracture]
    if "damage" in frame.names:
        drawn.append(_draw_damage(directory, body, frame))
    if "displacement" in frame.names:
        drawn.append(_draw_map(directory / "displacement.png", body, frame, "displacement", "displacement magnitude [m]", "viridis"))
        drawn.append(_draw_deformed(directory, body, frame))
    return drawn


def _draw_damage(directory, body, frame):
    """Draw the damage grown in the run, the pre-crack on top of it."""
    planes = planes_of(body)
    figure, all_axes = figure_of(body, planes)
    unit, factor = length_unit(body)
    rigids = read_impactors(directory, frame.step)
    for axes, plane in zip(all_axes, planes):
        shown = show_damage(axes, body, frame, plane, factor)
        draw_outlines(axes, rigids, plane, factor)
        dress(axes, plane, unit)
    figure.colorbar(shown, ax=list(all_axes), label="damage", shrink=0.85, pad=0.015, aspect=24)
    figure.suptitle(f"{title_of(directory)}   t = {time_text(frame.time)}{PRECRACK_WORDS if 'precrack' in frame.names else ''}", fontsize=12, color=INK)
    return save(figure, directory / "damage.png")


def _draw_map(path, body, frame, name, label, colours):
    """Draw the magnitude of a field."""
    planes = planes_of(body)
    figure, all_axes = figure_of(body, planes)
    unit, factor = length_unit(body)
    for axes, plane in zip(all_axes, planes):
        image, extent = pixels_of(body, frame, name, plane)
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
    rigids = [rigid.moved(scale) for rigid in read_impactors(directory, frame.step)]
    planes = planes_of(body)
    figure, all_axes = figure_of(body, planes)
    unit, factor = length_unit(body)
    for axes, plane in zip(all_axes, planes):
        if body.dim == 2 and body.count <= _MOST_SQUARES:
            shown = _show_squares(axes, body, frame, name, scale, factor)
        else:
            image, extent = pixels_of(body, frame, name, plane, scale)
            shown = axes.imshow(image, origin="lower", extent=[factor * x for x in extent], cmap="cividis", interpolation="nearest")
        draw_outlines(axes, rigids, plane, factor)
        dress(axes, plane, unit)
    figure.colorbar(shown, ax=list(all_axes), label=name if name == "damage" else "displacement magnitude [m]", shrink=0.85, pad=0.015, aspect=24)
    figure.suptitle(f"{title_of(directory)}   displacements x {scale:g}   t = {time_text(frame.time)}", fontsize=12, color=INK)
    return save(figure, directory / "deformed.png")


def _show_squares(axes, body, frame, name, scale, factor):
    """Draw every particle of a plane body where it is, displacements times `scale`; return the image."""
    points, values = next(frame.chunks(body, name))
    moved = factor * (points + scale * next(frame.chunks(body, "displacement"))[1][:, :2])
    side = body.spacing if body.on_lattice else next(body.side_chunks())
    shown = squares(moved, 0.9 * factor * side, np.linalg.norm(values, axis=1) if values.ndim == 2 else values, cmap="cividis")
    axes.add_collection(shown)
    axes.autoscale_view()
    return shown


def _draw_history(directory, curves):
    """Draw energies, tips and curves of history.csv."""
    history = read_history(directory / "history.csv")
    drawn = []
    time = history.get("time [s]", np.empty(0))
    label, factor = time_axis(directory, float(np.max(time, initial=0.0)))
    time = label, factor * time
    energies = [name for name in history if name.endswith("energy [J]") or name in ("external_work [J]", "balance_error [J]")]
    if energies and len(time[1]) > 1:
        drawn.append(_draw_lines(directory, "energies", "energy [J]", time, {name[:-4].replace("_", " "): history[name] for name in energies}))
    for name in [name[: -len(".speed [m/s]")] for name in history if name.endswith(".speed [m/s]")]:
        if len(time[1]) > 1:
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
        axes.plot(time[1], values, label=line, linewidth=1.6)
    axes.set(xlabel=time[0], ylabel=label, title=title_of(directory))
    axes.legend(frameon=False)
    return save(figure, directory / f"{name}.png")


def _draw_tip(directory, time, name, history):
    figure, (upper, lower) = _linesfigure(2)
    for column in [f"{name}.{axis} [m]" for axis in "xyz"]:
        if column in history:
            upper.plot(time[1], 1e3 * history[column], label=column.split(".")[1][0], linewidth=1.6)
    upper.set(ylabel="tip position [mm]", title=f"{title_of(directory)}   tip '{name}'")
    upper.legend(frameon=False)
    lower.plot(time[1], history[f"{name}.speed [m/s]"], color="#d9480f", linewidth=1.6)
    lower.set(xlabel=time[0], ylabel="tip speed [m/s]")
    return save(figure, directory / f"tip_{name}.png")


def _draw_curve(directory, name, x, y, history):
    figure, (axes,) = _linesfigure()
    axes.plot(history[x], history[y], linewidth=1.6, color=INK)
    axes.set(xlabel=x, ylabel=y, title=f"{title_of(directory)}   {name}")
    return save(figure, directory / f"curve_{name}.png")
