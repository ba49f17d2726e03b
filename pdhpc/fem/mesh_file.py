"""A mesh as a file tells it, checked: one kind of cell, its regions, and the named facets on its surface. On one rank."""
import contextlib
import io
import re
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.fem.facets import DIM, FACETS, UNIT_CORNERS, find_outer_facets
from pdhpc.jit import kernel

_FACET_KIND = {"triangle": "line", "quad": "line", "tetra": "triangle", "hexahedron": "quad"}
_N_CORNERS = {"line": 2, **{kind: len(corners) for kind, corners in UNIT_CORNERS.items()}}
_TAGS = ("gmsh:physical", "medit:ref", "CellEntityIds")  # cell data whose numbers name groups
_LONGEST = 120  # characters of what meshio says of a file
_FLAT = 1e-10  # of the product of its edges: below this the determinant of a cell's corner is taken for zero

_CORNERS = {  # a corner and its neighbours along the axes of a right-handed frame
    "triangle": [(0, 1, 2)],
    "quad": [(0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)],
    "tetra": [(0, 1, 2, 3)],
    "hexahedron": [(0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7), (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)],
}
_MIRRORED = {"triangle": [0, 2, 1], "quad": [0, 3, 2, 1], "tetra": [0, 2, 1, 3], "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3]}


class FileMesh(NamedTuple):
    """All of a mesh.

    kind : of its cells. points : (n_vertices, dim), m, those that a cell touches. vertex_id : (n_vertices,) int64, their places in the file, ascending.
    cells : (n_cells, corners) int32, in the file's order, right-handed. regions : {name: (n_cells,) bool}.
    sets : {name: (cell, facet)}, (n,) int32 each: facets of the body's surface, places in FACETS. repeated : cells left out because they stood there before, see count_repeated.
    """

    kind: str
    points: np.ndarray
    vertex_id: np.ndarray
    cells: np.ndarray
    regions: dict
    sets: dict
    repeated: int = 0


def read_file(path):
    """Return the FileMesh of a file that meshio can read. Local.

    Groups of cells are regions, groups of facets and of points (all vertices of a facet are in it) are sets: gmsh's physical groups by name, or by number
    without one, and what else meshio calls cell sets and point sets. Facets of a group that are not on the surface are left out. Cells of the other
    orientation are turned round; a cell that stands in the file twice, as in two groups of gmsh's format 2, counts once.

    Raises
    ------
    ValueError: no such file, not readable, no cells or several kinds of them, corners that are missing, points that are not finite or not in a plane, flat or
    folded cells.
    """
    raw = _read_raw(Path(path))
    try:
        kind = _find_kind(raw)
        _check_corners(raw)
        blocks = [(number, np.asarray(block.data)) for number, block in enumerate(raw.cells) if block.type == kind and len(block.data)]
        cells = np.concatenate([data for _, data in blocks])
        points = np.asarray(raw.points, float)
        first, place = _merge_same(cells)
        vertex_id = np.unique(cells)
        number = np.full(len(points), -1, np.int32)
        number[vertex_id] = np.arange(len(vertex_id), dtype=np.int32)
        points, cells = _flatten(points[vertex_id], DIM[kind]), number[cells[first]]
        _turn_round(kind, points, cells)
        groups = _find_groups(raw)
        regions = {}
        for name, chosen in groups.items():
            marked = np.concatenate([chosen.get(block, np.zeros(len(data), bool)) for block, data in blocks])
            if marked.any():
                regions[name] = np.zeros(len(cells), bool)
                regions[name][place[marked]] = True
        sets = _find_sets(raw, kind, cells, number, groups)
        repeated = count_repeated(first, place, blocks, groups)
    except ValueError as wrong:
        raise ValueError(f"the mesh {path} {wrong}") from None
    return FileMesh(kind, points, vertex_id.astype(np.int64), cells, regions, sets, repeated)


def _read_raw(path):
    """Return meshio's mesh of a file."""
    if not path.is_file():
        raise ValueError(f"there is no mesh {path}")
    import meshio

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():  # meshio prints, and may end the interpreter
            warnings.simplefilter("ignore")
            return meshio.read(path)
    except (Exception, SystemExit) as failure:
        raise ValueError(f"the mesh {path} cannot be read: {_reason(failure, said.getvalue())}") from failure


def _reason(failure, said):
    """Return why meshio gave a file up, in the place of the words of the libraries that it calls, which speak of arrays and bytes; said : what it printed."""
    import meshio

    if isinstance(failure, ImportError):
        return f"that takes the package {failure.name}, which is not installed"
    if isinstance(failure, OSError) and failure.strerror:
        return failure.strerror
    own = " ".join(f"{failure if isinstance(failure, meshio.ReadError) else ''} {said}".split())
    own = re.sub(r"(Error: Couldn't read file.*|Warning: )", "", own).strip(" .")
    own = f" (meshio says: {own[:_LONGEST]}{'...' if len(own) > _LONGEST else ''})" if own else ""
    return f"it is cut short, damaged, or of another kind than its name says{own}"


def _find_kind(raw):
    """Return the one kind of cell."""
    kinds = {block.type for block in raw.cells if len(block.data)}
    other = sorted(kinds - {"vertex", "line", *DIM})
    if other:
        raise ValueError(f"has cells of kind {', '.join(other)}; a mesh has cells of one of the kinds {', '.join(sorted(DIM))}")
    found = [kind for kind in sorted(kinds) if kind in DIM]
    solid = [kind for kind in found if DIM[kind] == 3] or found
    if not solid:
        raise ValueError(f"has no cells; a mesh has cells of one of the kinds {', '.join(sorted(DIM))}")
    if len(solid) > 1:
        raise ValueError(f"has cells of several kinds, {' and '.join(solid)}; a mesh has cells of one kind")
    return solid[0]


def _check_corners(raw):
    """Raise a ValueError unless the cells and facets have the corners of their kinds, which are points of the mesh."""
    for block in raw.cells:
        corners, n = np.asarray(block.data), _N_CORNERS.get(block.type, 1)
        if len(corners) == 0:
            continue
        if corners.shape != (len(corners), n):
            raise ValueError(f"has cells of kind {block.type} without all of their {n} corners")
        if not 0 <= corners.min() <= corners.max() < len(raw.points):
            raise ValueError("has cells with points that it does not hold")


def _label_rows(rows):
    """Return (n,) int64, the same number for rows (n, m) of the same integers in any order."""
    rows = np.sort(rows, axis=1)
    order = np.lexsort(rows.T)
    label = np.empty(len(rows), np.int64)
    label[order] = np.cumsum(np.concatenate(([False], (rows[order[1:]] != rows[order[:-1]]).any(axis=1)))[: len(rows)])
    return label


def _merge_same(cells):
    """Return (first, place): which cells to keep, in order, and where among them each one or its like is."""
    label = _label_rows(cells)
    first_of = np.empty(label.max() + 1, np.int64)
    first_of[label[::-1]] = np.arange(len(label))[::-1]
    first = np.sort(first_of)
    return first, np.searchsorted(first, first_of[label])


def count_repeated(first, place, blocks, groups):
    """Return how many cells stand in a file again without a group of their own, other than gmsh's format 2 has it, where a cell stands once in each of its groups.

    first, place : of _merge_same. blocks : [(number, cells)] of one kind. groups : of _find_groups.
    """
    groups_of = np.zeros(len(place), np.uint64)  # a number that tells different sets of groups apart
    for number, chosen in enumerate(groups.values()):
        marked = np.concatenate([chosen.get(block, np.zeros(len(data), bool)) for block, data in blocks])
        groups_of[marked] ^= np.uint64(0x9E3779B97F4A7C15 * (number + 1) % 2**64)
    again = np.ones(len(place), bool)
    again[first] = False
    return int(np.count_nonzero(groups_of[again] == groups_of[first][place[again]]))


def _flatten(points, dim):
    """Return points (n, dim), after a check of the coordinates."""
    if not np.isfinite(points).all():
        raise ValueError(f"has {np.count_nonzero(~np.isfinite(points).all(axis=1))} points with coordinates that are not finite")
    if points.shape[1] < dim:
        raise ValueError(f"has cells of {dim} dimensions, but points of {points.shape[1]}")
    height = np.ptp(points[:, dim:], axis=0).max(initial=0.0)
    if height > 1e-9 * np.ptp(points, axis=0).max():
        raise ValueError(f"has plane cells whose third coordinate is not the same everywhere, but spans {height:g} m")
    return np.ascontiguousarray(points[:, :dim])


def _turn_round(kind, points, cells):
    """Mirror the cells (n, corners) of the other orientation, in place."""
    low, high = np.empty(len(cells)), np.empty(len(cells))
    _find_determinants(points, cells, np.array(_CORNERS[kind]), low, high)
    bad = np.flatnonzero(~((low > _FLAT) | (high < -_FLAT)))
    if len(bad):
        centre = points[cells[bad[0]]].mean(axis=0)
        raise ValueError(f"has {len(bad)} flat or folded cells, the first of them around ({', '.join(f'{x:g}' for x in centre)}) m")
    turned = high < 0.0
    cells[turned] = cells[turned][:, _MIRRORED[kind]]


@kernel
def _find_determinants(points, cells, corners, low, high):
    """Set low[c], high[c] to the least and largest determinant of the edges at corners of a cell, over the product of their lengths."""
    dim = points.shape[1]
    edge = np.empty((dim, dim))
    for c in range(len(cells)):
        low[c], high[c] = np.inf, -np.inf
        for k in range(len(corners)):
            size = 1.0
            for m in range(dim):
                square = 0.0
                for d in range(dim):
                    edge[m, d] = points[cells[c, corners[k, m + 1]], d] - points[cells[c, corners[k, 0]], d]
                    square += edge[m, d] ** 2
                size *= np.sqrt(square)
            value = edge[0, 0] * edge[1, 1] - edge[0, 1] * edge[1, 0]
            if dim == 3:
                value = value * edge[2, 2] + (edge[0, 1] * edge[1, 2] - edge[0, 2] * edge[1, 1]) * edge[2, 0]
                value += (edge[0, 2] * edge[1, 0] - edge[0, 0] * edge[1, 2]) * edge[2, 1]
            value = value / size if size > 0.0 else 0.0
            low[c], high[c] = min(low[c], value), max(high[c], value)


def _find_groups(raw):
    """Return {name: {block: (n,) bool}}: which of its cells or facets each group of the file holds."""
    groups = {}

    def add(name, block, chosen):
        marks = groups.setdefault(name, {}).setdefault(block, np.zeros(len(raw.cells[block].data), bool))
        marks[chosen] = True

    names = {(int(numbers[0]), int(numbers[1])): name for name, numbers in raw.field_data.items() if np.size(numbers) == 2}
    for key in _TAGS:
        for block, tags in enumerate(raw.cell_data.get(key, [])):
            dim = DIM.get(raw.cells[block].type, {"line": 1}.get(raw.cells[block].type, 0))
            for tag in np.unique(tags):
                if tag:
                    add(names.get((int(tag), dim), str(int(tag))), block, np.asarray(tags) == tag)
    for name, members in raw.cell_sets.items():
        for block, chosen in enumerate(members if not name.startswith("gmsh:") else ()):
            if chosen is not None and len(chosen):
                add(name, block, np.asarray(chosen, np.int64))
    return groups


def _find_sets(raw, kind, cells, number, groups):
    """Return {name: (cell, facet)} of groups of facets and of points."""
    cell, facet = find_outer_facets(kind, cells, len(cells), int(cells.max()) + 1)
    surface = cells[cell[:, None], FACETS[kind][facet]]
    sets = {}
    for name, blocks in groups.items():
        chosen = [np.asarray(raw.cells[block].data)[marks] for block, marks in blocks.items() if raw.cells[block].type == _FACET_KIND[kind]]
        if chosen:
            label = _label_rows(np.concatenate([surface, number[np.concatenate(chosen)]]))
            on_surface = np.isin(label[: len(surface)], label[len(surface) :])
            sets[name] = cell[on_surface], facet[on_surface]
    for name, chosen in raw.point_sets.items():
        within = np.zeros(int(cells.max()) + 1, bool)
        vertices = number[np.asarray(chosen, np.int64)]
        within[vertices[vertices >= 0]] = True
        on_surface = within[surface].all(axis=1)
        if name not in sets:
            sets[name] = cell[on_surface], facet[on_surface]
    return sets
