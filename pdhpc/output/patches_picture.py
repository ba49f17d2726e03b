"""The picture of the patches of a coupled run over its damage: mesh, enriched cells, and what the particles in them lost."""
from pathlib import Path

import numpy as np

from pdhpc.output.enrichment_file import NAME, read_enrichment
from pdhpc.output.fields import frame_times
from pdhpc.output.figure import INK, dress, figure_of, length_unit, planes_of, save, time_text, title_of
from pdhpc.output.pixels import PRECRACK_WORDS, Body, Frame, show_damage

_MOST_LINES = 20_000  # cells up to which all of them are outlined; beyond, the enriched ones alone
_LEAST = 0.01  # damage that is drawn
_LOOKS = {0: ("elements", "#f3f5f7"), 1: ("ramp between both", "#d3e2f0"), 2: ("particles", "#a9c8e4")}  # by cells/patch


def draw_patches(directory):
    """Draw patches.png from the files in `directory`; return its path, or None where there is no enrichment.h5 or no field of two dimensions. Local."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.transforms import offset_copy

    directory = Path(directory)
    if not (directory / NAME).exists() or not (directory / "fields.h5").exists() or not frame_times(directory):
        return None
    data, attributes = read_enrichment(directory)
    body, frame = Body(directory), Frame(directory)
    if body.dim != 2:
        return None
    unit, factor = length_unit(body)
    figure, (axes,) = figure_of(body, planes_of(body))
    _shade(axes, factor * corners_of(data), data["cells/patch"])
    if "damage" in frame.names:
        shown = show_damage(axes, body, frame, (0, 1), factor, least=_LEAST)
        figure.colorbar(shown, ax=axes, label="damage", shrink=0.85, pad=0.015, aspect=24)
    _outline(axes, factor * corners_of(data), data["cells/patch"])
    axes.autoscale_view()
    dress(axes, (0, 1), unit)
    below = offset_copy(axes.transAxes, fig=figure, y=-0.45, units="inches")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), bbox_transform=below, ncol=3, frameon=False, fontsize=9)
    words = PRECRACK_WORDS if "precrack" in frame.names else ""
    figure.suptitle(f"{title_of(directory)}   t = {time_text(attributes['time'])}{words}", fontsize=11, color=INK)
    return save(figure, directory / "patches.png")


def corners_of(data):
    """Return (n_cells, corners, dim), m, the corners of all cells of an enrichment.h5."""
    ids, order = data["vertices/id"], np.argsort(data["vertices/id"])
    return data["vertices/position"][order[np.searchsorted(ids[order], data["cells/vertex"])]]


def _shade(axes, corners, patch):
    """Fill cells by what patches they belong to, and say how many there are."""
    from matplotlib.collections import PolyCollection

    for state, (words, colour) in _LOOKS.items():
        cells = corners[patch == state]
        if len(cells) == 0:
            continue
        axes.add_collection(PolyCollection(cells, facecolors=colour, edgecolors=colour, linewidths=0.3, zorder=-2, label=f"{words}: {len(cells):,} cells"))


def _outline(axes, corners, patch):
    """Draw the mesh."""
    from matplotlib.collections import PolyCollection

    outlined = corners if len(corners) <= _MOST_LINES else corners[patch > 0]
    axes.add_collection(PolyCollection(outlined, facecolors="none", edgecolors=INK, linewidths=0.35, alpha=0.35, zorder=2))
