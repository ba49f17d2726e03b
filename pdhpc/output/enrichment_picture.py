"""The picture of an enriched space, drawn from enrichment.h5 and the last frame of the fields: patches, enriched vertices, functions, mass matrix."""
from pathlib import Path

import numpy as np

from pdhpc.output.enrichment_file import NAME, read_enrichment
from pdhpc.output.fields import read_frame, read_points

_MOST_PARTICLES = 300_000  # drawn one by one
_MOST_ENTRIES = 500_000
_INK, _PAPER = "#1b1f24", "white"


def draw_enrichment(directory):
    """Draw enrichment.png from the files in `directory`; return its path, or None where there is no enrichment.h5 or it is not of two dimensions. Local."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    directory = Path(directory)
    if not (directory / NAME).exists():
        return None
    data, attributes = read_enrichment(directory)
    if data["vertices/position"].shape[1] != 2:
        return None
    panels = _panels(directory, data, attributes["spacing"])
    columns = -(-len(panels) // 2) if len(panels) > 3 else len(panels)
    rows = -(-len(panels) // columns)
    figure, all_axes = plt.subplots(rows, columns, figsize=(4.6 * columns, 4.0 * rows), squeeze=False, facecolor=_PAPER, constrained_layout=True)
    for axes in all_axes.flat[len(panels) :]:
        axes.axis("off")
    for axes, (panel, *args) in zip(all_axes.flat, panels):
        panel(figure, axes, *args)
        axes.tick_params(labelsize=8)
    figure.suptitle(f'scheme "{attributes["scheme"]}", t = {attributes["time"]:.4g} s', fontsize=12, color=_INK)
    path = directory / "enrichment.png"
    part = path.with_name("enrichment.part.png")
    figure.savefig(part, dpi=110, facecolor=_PAPER)
    plt.close(figure)
    part.replace(path)
    return path


def _panels(directory, data, spacing):
    """Return [(function, arguments)] of what there is to draw."""
    panels, particles = [], _particles(directory)
    if particles is not None and "damage" in particles:
        panels.append((_draw_particles, particles, spacing))
    if "points/eta" in data:
        eta = np.linalg.norm(data["points/eta"], axis=1)
        panels.append((_draw_field, "reconstructed field |eta| [m]", data["points/position"], eta, spacing))
    panels.append((_draw_vertices, data))
    for k in range(data["points/functions"].shape[1] if "points/functions" in data else 0):
        vertex, component = int(data["functions/vertex"][k]), int(data["functions/component"][k])
        label = f"phi_{vertex} eta_{'xyz'[component]} [m]"
        panels.append((_draw_field, label, data["points/position"], data["points/functions"][:, k], spacing))
    if "entries/row" in data and len(data["entries/row"]) <= _MOST_ENTRIES:
        panels.append((_draw_pattern, data))
    if particles is not None:
        panels.append((_draw_field, "displacement [m]", particles["position"], np.linalg.norm(particles["displacement"], axis=1), spacing))
    return panels


def _particles(directory):
    """Return {"position", "displacement", "damage" if stored} of the last frame, or None: no displacements are stored, or they are too many."""
    if not (directory / "fields.h5").exists():
        return None
    points = read_points(directory)
    if len(points["id"]) > _MOST_PARTICLES:
        return None
    _, _, fields = read_frame(directory, -1, ["displacement", "damage"])
    if "displacement" not in fields:
        return None
    return {**fields, "position": points["position"], "displacement": fields["displacement"][:, :2]}


def _draw_particles(figure, axes, particles, spacing):
    """Draw where particles are, displacements scaled so that the largest is 8 % of the body, coloured by damage."""
    position, u = particles["position"], particles["displacement"]
    size, largest = float(np.ptp(position, axis=0).max()), float(np.abs(u).max(initial=0.0))
    scale = 0.08 * size / largest if largest > 0.0 else 1.0
    moved = position + scale * u
    marks = max(0.05, (220.0 * spacing / size) ** 2)
    shown = axes.scatter(moved[:, 0], moved[:, 1], c=particles["damage"], s=marks, cmap="viridis", linewidths=0)
    figure.colorbar(shown, ax=axes, shrink=0.8)
    axes.set(title=f"particles, damage (u x {scale:.3g})", aspect="equal")


def _draw_field(figure, axes, title, position, values, spacing):
    """Draw values at particles of a lattice as pixels, in colours of two signs where some are below 0."""
    if len(position) == 0:
        axes.set(title=title)
        return
    low = position.min(axis=0)
    index = np.rint((position - low) / spacing).astype(int)
    image = np.full(index.max(axis=0) + 1, np.nan)
    image[index[:, 0], index[:, 1]] = values
    extent = np.stack([low - spacing / 2, low + (np.array(image.shape) - 0.5) * spacing], axis=1).ravel()
    limit = np.abs(values).max() if values.min() < 0.0 else None
    shown = axes.imshow(image.T, origin="lower", extent=extent, cmap="viridis" if limit is None else "RdBu_r", interpolation="nearest",
                        vmin=None if limit is None else -limit, vmax=limit)
    figure.colorbar(shown, ax=axes, shrink=0.8)
    axes.set(title=title, aspect="equal")


def _draw_vertices(figure, axes, data):
    """Draw the vertices of the mesh, those in J, and those enriched in x and in y."""
    place, patch, enriched = data["vertices/position"], data["vertices/patch"] > 0, data["vertices/enriched"] > 0
    size = max(3.0, min(11.0, 260.0 / np.sqrt(len(place))))
    axes.plot(*place.T, ".", color="#9aa5ad", markersize=size / 4)
    axes.plot(*place[patch].T, ".", color=_INK, markersize=size / 2.5, label=f"patches: {patch.sum()}")
    axes.plot(*place[enriched[:, 0]].T, "x", color="#c92a2a", markersize=0.8 * size, label=f"x enriched: {enriched[:, 0].sum()}")
    axes.plot(*place[enriched[:, 1]].T, "o", color="#1864ab", markersize=size, markerfacecolor="none", label=f"y enriched: {enriched[:, 1].sum()}")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), fontsize=7, frameon=False, ncols=3)
    axes.set(title="enriched vertices", aspect="equal")


def _draw_pattern(figure, axes, data):
    """Draw where the mass matrix is not 0; unknowns by component, standard ones first, vertices ascending."""
    order = np.lexsort([data[f"unknowns/{name}"] for name in ("vertex", "enriched", "component")])
    number = data["unknowns/number"][order]
    by_number = np.argsort(number)
    row, column = (by_number[np.searchsorted(number[by_number], data[f"entries/{name}"])] for name in ("row", "column"))
    axes.plot(column, row, ",", color="#1864ab") if len(number) > 400 else axes.plot(column, row, "s", color="#1864ab", markersize=220.0 / max(len(number), 1))
    axes.set(title=f"mass matrix, {len(number)} unknowns", xlim=(-0.5, len(number) - 0.5), ylim=(len(number) - 0.5, -0.5), aspect="equal")
