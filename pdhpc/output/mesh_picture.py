"""Pictures of a run on a mesh, drawn from its output files alone: fields on the cells of 2D bodies, on the surface of 3D ones along each axis."""
from pathlib import Path

import numpy as np

from pdhpc.output.fields import read_frame, read_points
from pdhpc.output.figure import INK, dress, figure_of, length_unit, planes_of, rounded, save, time_text, title_of

_TRIANGLES = {3: [(0, 1, 2)], 4: [(0, 1, 2), (0, 2, 3)]}  # of a facet with so many corners
_FACETS = {  # of cells in 3D, VTK order
    4: [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)],
    8: [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
}
_MOST_EDGES = 20_000  # facets up to which their edges are drawn


class _Mesh:
    """The surface of a run's mesh: in 2D its cells, in 3D the facets that one cell alone has.

    points (n, dim), m. facets (m, 3 or 4). lower, upper, spacing, dim : as figures want them.
    """

    def __init__(self, directory):
        points = read_points(directory)
        self.points, cells = points["position"], points["cells"]
        self.dim, self.spacing = self.points.shape[1], 0.0
        self.lower, self.upper = self.points.min(axis=0), self.points.max(axis=0)
        self.facets = cells if self.dim == 2 else _outer(cells)


def _outer(cells):
    """Return (m, 3 or 4), the facets of cells in 3D that only one of them has."""
    facets = cells[:, np.array(_FACETS[cells.shape[1]])].reshape(-1, 3 if cells.shape[1] == 4 else 4)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return facets[first[count == 1]]


def draw_mesh(directory, index=-1):
    """Draw displacement, largest principal stress and the deformed mesh of the index-th frame, those there is data for; return their paths. Local."""
    directory = Path(directory)
    mesh = _Mesh(directory)
    time, _, fields = read_frame(directory, index)
    when, drawn = f"t = {time_text(time)}", []
    u = fields.get("displacement")
    maps = []
    if u is not None:
        maps.append(("displacement", np.linalg.norm(u, axis=1), "displacement magnitude [m]", "viridis"))
    if "stress" in fields:
        maps.append(("stress", _largest_principal(fields["stress"], mesh.dim), "largest principal stress [Pa]", "inferno"))
    for name, values, label, colours in maps:
        drawn.append(_draw(directory / f"{name}.png", mesh, mesh.points, (values, label, colours), f"{title_of(directory)}   {when}"))
    if u is not None:
        scale = _scale(mesh, u)
        title = f"{title_of(directory)}   displacements x {scale:g}   {when}"
        drawn.append(_draw(directory / "deformed.png", mesh, mesh.points + scale * u[:, : mesh.dim], maps[-1][1:], title))
    return drawn


def _largest_principal(stress, dim):
    """Return (n,), Pa; stress (n, 9)."""
    tensors = stress.reshape(-1, 3, 3)[:, :dim, :dim]
    finite = np.isfinite(tensors).all(axis=(1, 2))
    return np.where(finite, np.linalg.eigvalsh(np.where(finite[:, None, None], tensors, 0.0))[:, -1], np.nan)


def _scale(mesh, u):
    """Return what displacements are drawn times: so that the largest is about 3 % of the body, 1 when it is more already."""
    largest, size = float(np.max(np.linalg.norm(u, axis=1), initial=0.0)), float(np.max(mesh.upper - mesh.lower))
    if not (largest > 0 and size > 0 and np.isfinite(largest)) or largest > 0.03 * size:
        return 1.0
    return rounded(0.03 * size / largest)


def _draw(path, mesh, points, shown, title):
    """Draw one field on the mesh whose vertices lie at `points`; shown : (values (n,), label, colours)."""
    values, label, colours = shown
    planes = planes_of(mesh)
    figure, all_axes = figure_of(mesh, planes)
    unit, factor = length_unit(mesh)
    limits = (float(np.nanmin(values)), float(np.nanmax(values))) if np.isfinite(values).any() else (0.0, 1.0)
    for axes, plane in zip(all_axes, planes):
        place = factor * points[:, list(plane)]
        draw = _draw_cells if mesh.dim == 2 else _draw_surface
        image = draw(axes, mesh, place, points, plane, values, colours)
        image.set_clim(*limits)
        axes.autoscale_view()
        dress(axes, plane, unit)
    figure.colorbar(image, ax=list(all_axes), label=label, shrink=0.85, pad=0.015, aspect=24)
    figure.suptitle(title, fontsize=12, color=INK)
    return save(figure, path)


def _draw_cells(axes, mesh, place, points, plane, values, colours):
    """Draw a field of a plane mesh, linear on triangles, under the edges of its cells."""
    from matplotlib.collections import PolyCollection

    triangles = np.concatenate([mesh.facets[:, list(corners)] for corners in _TRIANGLES[mesh.facets.shape[1]]])
    image = axes.tripcolor(place[:, 0], place[:, 1], triangles, values, cmap=colours, shading="gouraud")
    if len(mesh.facets) <= _MOST_EDGES:
        axes.add_collection(PolyCollection(place[mesh.facets], facecolors="none", edgecolors=INK, linewidths=0.15, alpha=0.6))
    return image


def _draw_surface(axes, mesh, place, points, plane, values, colours):
    """Draw the mean of a field on each facet of the surface, those in front on top."""
    from matplotlib.collections import PolyCollection

    depth = points[:, ({0, 1, 2} - set(plane)).pop()][mesh.facets].mean(axis=1)
    order = np.argsort(depth if plane != (0, 2) else -depth, kind="stable")  # seen against the third axis of a right-handed system
    facets = mesh.facets[order]
    edges = {"edgecolors": INK, "linewidths": 0.1} if len(facets) <= _MOST_EDGES else {"edgecolors": "face", "linewidths": 0.2}
    image = PolyCollection(place[facets], array=values[facets].mean(axis=1), cmap=colours, **edges)
    axes.add_collection(image)
    return image
