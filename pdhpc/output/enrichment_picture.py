"""The picture of an enriched space, drawn from enrichment.h5 and the last frame: particles, rebuilt field, enriched vertices, functions, mass matrix."""
from pathlib import Path

import numpy as np

from pdhpc.output.enrichment_file import NAME, read_enrichment
from pdhpc.output.fields import frame_times, read_frame, read_points
from pdhpc.output.figure import INK, PAPER, beside, crack_colours, rounded, save, small_unit, squares, time_text, title_of
from pdhpc.output.patches_picture import corners_of

_MOST_PARTICLES = 100_000  # drawn one by one
_MOST_CELLS = 20_000  # outlined
_MOST_ENTRIES = 500_000
_WIDTH, _COLUMNS = 4.4, 3  # of a panel, inches; panels side by side
_SHOWN_SIZE = 0.08  # of the body: largest displacement as drawn
_RED, _BLUE, _GREY = "#c92a2a", "#1864ab", "#8a959c"


def draw_enrichment(directory):
    """Draw enrichment.png from the files in `directory`; return its path, or None where there is no enrichment.h5 or it is not of two dimensions. Local."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    directory = Path(directory)
    if not (directory / NAME).exists():
        return None
    space = _Space(directory)
    if space.dim != 2:
        return None
    panels = _panels(space)
    rows = -(-len(panels) // _COLUMNS)
    extent = np.ptp(space.corners.reshape(-1, 2), axis=0)
    height = np.clip(0.75 * _WIDTH * extent[1] / extent[0], 0.35 * _WIDTH, 1.4 * _WIDTH) + 0.7
    figure, all_axes = plt.subplots(rows, _COLUMNS, figsize=(_WIDTH * _COLUMNS, height * rows + 0.5), squeeze=False, facecolor=PAPER, constrained_layout=True)
    for axes in all_axes.flat[len(panels) :]:
        axes.axis("off")
    for axes, (panel, *arguments) in zip(all_axes.flat, panels):
        panel(figure, axes, space, *arguments)
        axes.tick_params(labelsize=8)
        axes.title.set_fontsize(11)
    tolerance = f", tolerance {space.attributes['tolerance']:g}" if "tolerance" in space.attributes else ""
    figure.suptitle(f"{title_of(directory)}   {space.attributes['scheme']}{tolerance}   t = {time_text(space.attributes['time'])}", fontsize=13, color=INK)
    return save(figure, directory / "enrichment.png")


class _Space:
    """What a run wrote of its enriched space, lengths in a unit to be shown in.

    data, attributes : of enrichment.h5. size of the body, m. corners (n_cells, 4, 2) of cells. unit, factor : of lengths.
    particles : {"position", "displacement", "damage" if stored} of the last frame, m, or None: no displacements are stored, or they are too many.
    """

    def __init__(self, directory):
        self.data, self.attributes = read_enrichment(directory)
        self.dim = self.data["vertices/position"].shape[1]
        self.size = float(np.ptp(self.data["vertices/position"], axis=0).max())
        self.unit, self.factor = ("mm", 1e3) if self.size < 1.0 - 1e-9 else ("m", 1.0)
        self.corners = self.factor * corners_of(self.data)
        self.pixel, self.spacing = self.factor * self.attributes["pixel"], self.factor * self.attributes["spacing"]
        self.particles = _particles(directory)

    def zoom(self):
        """Return ((x, x), (y, y)), limits that show the enriched cells, or all without any."""
        held = self.corners[self.data["cells/patch"] > 0]
        points = (held if len(held) else self.corners).reshape(-1, 2)
        margin = 0.03 * np.ptp(points, axis=0).max()
        return tuple(zip(points.min(axis=0) - margin, points.max(axis=0) + margin))


def _particles(directory):
    if not (directory / "fields.h5").exists() or not frame_times(directory) or _count(directory) > _MOST_PARTICLES:
        return None
    _, _, fields = read_frame(directory, -1, ["displacement", "damage"])
    if "displacement" not in fields:
        return None
    return {**fields, "position": read_points(directory)["position"], "displacement": fields["displacement"][:, :2]}


def _count(directory):
    """Return the number of particles."""
    import h5py

    with h5py.File(directory / "fields" / "points.h5", "r") as file:
        return len(file["id"])


def _panels(space):
    """Return [(function, arguments)] of what there is to draw, in the order of a run's stages."""
    data, particles = space.data, space.particles
    panels = [] if particles is None else [(_draw_particles,)]
    panels += [(_draw_raster, f"$u_{axis}$ rebuilt from particles", data["raster/displacement"][:, k]) for k, axis in enumerate("xy")]
    panels.append((_draw_vertices,))
    for k, (vertex, component) in enumerate(zip(data.get("functions/vertex", ()), data.get("functions/component", ()))):
        place = space.factor * data["vertices/position"][data["vertices/id"] == vertex][0]
        title = rf"$\varphi_i\,u_{'xy'[component]}$,  $i$ at ({place[0]:.4g}, {place[1]:.4g}) {space.unit}"
        panels.append((_draw_raster, title, data["raster/functions"][:, k]))
    if 0 < len(data.get("entries/row", ())) <= _MOST_ENTRIES:
        panels.append((_draw_pattern,))
    if particles is not None:
        panels.append((_draw_displacement,))
    return panels


def _dress(axes, space, title):
    axes.set(title=title, xlabel=f"x [{space.unit}]", ylabel=f"y [{space.unit}]", aspect="equal")


def _draw_mesh(axes, space, colour=_GREY):
    """Outline the cells."""
    from matplotlib.collections import PolyCollection

    if len(space.corners) <= _MOST_CELLS:
        axes.add_collection(PolyCollection(space.corners, facecolors="none", edgecolors=colour, linewidths=0.5))


def _draw_particles(figure, axes, space):
    """Draw where particles are, displacements scaled to be seen, coloured by damage."""
    position, u = space.particles["position"], space.particles["displacement"]
    largest = float(np.abs(u).max(initial=0.0))
    scale = rounded(_SHOWN_SIZE * space.size / largest) if largest > 0.0 and np.isfinite(largest) else 1.0
    moved = space.factor * (position + scale * u)
    damage = space.particles.get("damage", np.zeros(len(moved)))
    shown = squares(moved, 0.8 * space.spacing, damage, cmap=crack_colours(), clim=(0.0, max(0.6, damage.max(initial=0.0))))
    axes.add_collection(shown)
    axes.autoscale_view()
    beside(figure, axes, shown, "damage")
    _dress(axes, space, f"particles, displacements x {scale:g}")


def _draw_raster(figure, axes, space, title, values):
    """Draw values, m, on the raster of enriched cells, in colours of two signs, under the mesh."""
    position = space.factor * space.data["raster/position"]
    if len(position):
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        unit, factor = small_unit(largest)
        limit = factor * largest or 1.0
        low = position.min(axis=0)
        index = np.rint((position - low) / space.pixel).astype(int)
        image = np.full(index.max(axis=0) + 1, np.nan)
        image[index[:, 0], index[:, 1]] = factor * values
        extent = np.stack([low - space.pixel / 2, low + (np.array(image.shape) - 0.5) * space.pixel], axis=1).ravel()
        shown = axes.imshow(image.T, origin="lower", extent=extent, cmap="RdBu_r", interpolation="nearest", vmin=-limit, vmax=limit)
        beside(figure, axes, shown, f"[{unit}]")
    _draw_mesh(axes, space)
    _dress(axes, space, title)
    x, y = space.zoom()
    axes.set(xlim=x, ylim=y)


def _draw_vertices(figure, axes, space):
    """Draw the vertices of the mesh, those in J, and those enriched in x and in y."""
    data = space.data
    place, patch, enriched = space.factor * data["vertices/position"], data["vertices/patch"] > 0, data["vertices/enriched"] > 0
    cell = np.ptp(space.corners[0], axis=0).max() / (space.factor * space.size) * 0.75 * _WIDTH * 72.0  # points
    size = min(11.0, 0.6 * cell)
    _draw_mesh(axes, space, "#dde2e6")
    axes.plot(*place[~patch].T, ".", color="#b4bdc4", markersize=size / 4)
    axes.plot(*place[patch].T, ".", color=INK, markersize=size / 2.5)
    axes.plot(*place[enriched[:, 0]].T, "x", color=_RED, markersize=0.8 * size, markeredgewidth=0.12 * size)
    axes.plot(*place[enriched[:, 1]].T, "o", color=_BLUE, markersize=size, markerfacecolor="none", markeredgewidth=0.12 * size)
    found = [int(enriched[:, k].sum()) for k in range(2)]
    _dress(axes, space, f"enriched: {found[0]} in x ($\\times$), {found[1]} in y ($\\circ$) of {len(place):,} vertices")


def _draw_pattern(figure, axes, space):
    """Draw where the mass matrix is not 0; unknowns by component, standard ones first, vertices ascending."""
    data = space.data
    order = np.lexsort([data[f"unknowns/{name}"] for name in ("vertex", "enriched", "component")])
    number = data["unknowns/number"][order]
    by_number = np.argsort(number)
    row, column = (by_number[np.searchsorted(number[by_number], data[f"entries/{name}"])] for name in ("row", "column"))
    size = max(len(number), 1)
    if size > 400:
        axes.plot(column, row, ",", color=_BLUE)
    else:
        axes.add_collection(squares(np.stack([column, row], axis=1), 0.85, np.zeros(len(row)), cmap=_one_colour(_BLUE)))
    count = int(data["unknowns/enriched"].sum())
    axes.set(title=f"mass matrix: {size - count} + {count} unknowns", xlabel="unknown, x then y", ylabel="unknown")
    axes.set(xlim=(-0.5, size - 0.5), ylim=(size - 0.5, -0.5), aspect="equal")


def _one_colour(colour):
    from matplotlib.colors import ListedColormap

    return ListedColormap([colour])


def _draw_displacement(figure, axes, space):
    """Draw the size of the displacement of all particles."""
    u = np.linalg.norm(space.particles["displacement"], axis=1)
    unit, factor = small_unit(float(u.max(initial=0.0)))
    shown = squares(space.factor * space.particles["position"], space.spacing, factor * u, cmap="viridis", antialiaseds=False)
    axes.add_collection(shown)
    axes.autoscale_view()
    beside(figure, axes, shown, f"[{unit}]")
    _dress(axes, space, "displacement $|u|$")
