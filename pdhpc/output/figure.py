"""What all pictures share: figures in a body's proportions, units, titles, and files written whole or not at all."""
import json
import textwrap
from pathlib import Path

import numpy as np

from pdhpc.output.record import OutputError, part_of

INK, PAPER = "#1b1f24", "white"
_LINE = 64  # characters of a title in a line, which leaves room for what pictures add


def planes_of(body):
    """Return the planes in which a body is shown, as pairs of axes."""
    return [(0, 1)] if body.dim == 2 else [(0, 1), (0, 2), (1, 2)]


def figure_of(body, planes):
    """Return (figure, one axes per plane) in the body's proportions."""
    import matplotlib.pyplot as plt

    extents = [(body.upper[list(plane)] - body.lower[list(plane)] + body.spacing) for plane in planes]
    width = 9.0
    heights = [min(9.0, max(1.6, 0.80 * width * extent[1] / extent[0])) for extent in extents]
    figure, axes = plt.subplots(len(planes), 1, figsize=(width, sum(heights) + 1.0 * len(planes)), gridspec_kw={"height_ratios": heights}, squeeze=False,
                                facecolor=PAPER, constrained_layout=True)
    return figure, axes[:, 0]


def length_unit(body):
    """Return (name, factor) of the unit that lengths of a body are shown in."""
    size = float(np.max(body.upper - body.lower, initial=0.0)) + body.spacing
    return ("mm", 1e3) if size < 1.0 - 1e-9 else ("m", 1.0)


def small_unit(largest):
    """Return (name, factor) of the unit for lengths up to `largest`, m."""
    for name, factor in (("m", 1.0), ("mm", 1e3), ("µm", 1e6)):
        if abs(largest) * factor >= 0.01:
            return name, factor
    return ("m", 1.0) if largest == 0 else ("nm", 1e9)


def beside(figure, axes, shown, label):
    """Put a colour bar beside axes, as high as they are."""
    bar = figure.colorbar(shown, cax=axes.inset_axes([1.03, 0.0, 0.04, 1.0]), label=label)
    bar.ax.tick_params(labelsize=8)
    bar.outline.set_visible(False)


def crack_colours(body=True):
    """Return the colours of damage, red where all bonds are gone, nothing where there is no particle; body : whether what is whole is shown too, pale."""
    from matplotlib.colors import LinearSegmentedColormap

    low = ["#e9edf0", "#c3d3dc", "#7fa3b8"] if body else ["#fff7d6", "#fee59a", "#fbcf5d"]
    colours = LinearSegmentedColormap.from_list("crack", low + ["#f2b134", "#d9480f", "#7a0c0c"])
    colours.set_bad(PAPER, 0.0)
    return colours


def squares(centres, side, values, **looks):
    """Return a collection of squares around centres (n, 2), coloured by values (n,); side : of all, or (n,)."""
    from matplotlib.collections import PolyCollection

    corners = 0.5 * np.reshape(side, (-1, 1, 1)) * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return PolyCollection(centres[:, None] + corners, array=values, linewidths=0, **looks)


def dress(axes, plane, unit):
    """Label the axes of a map and leave out its frame."""
    axes.set(xlabel=f"{'xyz'[plane[0]]} [{unit}]", ylabel=f"{'xyz'[plane[1]]} [{unit}]", aspect="equal")
    axes.tick_params(labelsize=9)
    for spine in axes.spines.values():
        spine.set_visible(False)


def rounded(number):
    """Return 1, 2 or 5 times a power of ten, at most `number`."""
    power = 10.0 ** np.floor(np.log10(number))
    return float(power * max(step for step in (1, 2, 5) if step * power <= number * (1 + 1e-9)))


def time_text(time):
    """Return a time with a unit that suits it."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if abs(time) * factor >= 1 or time == 0:
            return f"{time * factor:.4g} {unit}"
    return f"{time * 1e9:.4g} ns"


def title_of(directory):
    """Return the title of the run, or the folder's name, in at most two lines that fit on a picture."""
    title = _record_of(directory).get("title") or Path(directory).name
    return "\n".join(textwrap.wrap(title, _LINE, max_lines=2, placeholder=" ...")) or title


def time_axis(directory, last):
    """Return (label, factor) of an axis of times up to `last`, s; bodies that stand still follow a load path, whose time is a parameter."""
    record = _record_of(directory)
    if "equilibrium" in record or record.get("integration") == "static":
        return "load parameter: time of the load path [s]", 1.0
    unit, factor = next(((unit, factor) for unit, factor in (("s", 1.0), ("ms", 1e3)) if last * factor >= 1.0), ("µs", 1e6))
    return f"time [{unit}]", factor


def _record_of(directory):
    """Return the record of a run, run.json; nothing where it cannot be read."""
    try:
        return json.loads((Path(directory) / "run.json").read_text())
    except (OSError, ValueError):
        return {}


def save(figure, path):
    """Write a picture whole or not at all; return its path.

    Raises
    ------
    OutputError: it cannot be written.
    """
    import matplotlib.pyplot as plt

    try:
        part = part_of(path)
        figure.savefig(part, dpi=130, facecolor=figure.get_facecolor())
        part.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        plt.close(figure)
    return path
