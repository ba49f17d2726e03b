"""The cells of a mesh file as points: their centroids, their volumes, and the groups they belong to. On one rank."""
import os
from pathlib import Path

import numpy as np

from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.facets import DIM, FACETS, UNIT_CORNERS
from pdhpc.fem.mesh_file import _FACET_KIND, _check_corners, _find_groups, _flatten, _label_rows, _merge_same, _read_raw, _turn_round, count_repeated
from pdhpc.jit import kernel

_TIMES_FILE = 4  # memory while a binary file is read, in sizes of the file
_PIECE = 1 << 18  # cells that become points at once


class CellFile:
    """A mesh file, read whole.

    Memory while reading: some 430 bytes for a hexahedron, which is four times a binary file (meshio's arrays, and the corners three times over).

    Attributes
    ----------
    dim : of the cells, 2 or 3. count : number of cells. repeated : of those left out because they stand there twice, see mesh_file.count_repeated. groups : names of all groups. cell_groups : names of those that hold cells.
    """

    def __init__(self, path):
        """Read a file of triangles and quads, or of tetrahedra and hexahedra, that meshio can read; cells that stand in it twice count once.

        Raises
        ------
        ValueError: no such file, too large for this machine, not readable, no cells or cells of other kinds, corners that are missing, points that are not finite or not in a plane, flat or folded cells.
        """
        _check_size(Path(path))
        raw = _read_raw(Path(path))
        try:
            self._take(raw)
        except ValueError as wrong:
            raise ValueError(f"the mesh {path} {wrong}") from None
        except IndexError:
            raise ValueError(f"the mesh {path} has groups of points or cells that it does not hold") from None

    def _take(self, raw):
        kinds = _find_kinds(raw)
        _check_corners(raw)
        self.dim = DIM[kinds[0]]
        points = np.asarray(raw.points, float)
        blocks = {kind: [(number, np.asarray(block.data)) for number, block in enumerate(raw.cells) if block.type == kind and len(block.data)] for kind in kinds}
        cells = {kind: np.concatenate([data for _, data in blocks[kind]]) for kind in kinds}
        used = np.zeros(len(points), bool)
        for each in cells.values():
            used[each] = True
        number = np.where(used, np.cumsum(used) - 1, -1)
        self._points, self._kinds, self._cells, self._groups = _flatten(points[used], self.dim), kinds, [], []
        groups = _find_groups(raw)
        tagged, self.repeated = _find_tagged(raw, groups, number, self.dim), 0
        for kind in kinds:
            first, place = _merge_same(cells[kind])
            self.repeated += count_repeated(first, place, blocks[kind], groups)
            own = number[cells[kind][first]].astype(np.int32)
            _turn_round(kind, self._points, own)
            self._cells.append(own)
            self._groups.append(_members(kind, own, place, blocks[kind], groups, tagged, len(self._points)))
        self.count = sum(len(each) for each in self._cells)
        self.cell_groups = sorted({name for each in self._groups for name, (_, is_cells) in each.items() if is_cells})
        self.groups = sorted({name for each in self._groups for name in each})

    def pieces(self, names):
        """Yield (points (n, dim) m, volume (n,) m^dim, marks (n,) uint64) of the cells, in the file's order of kinds and cells.

        marks : bit k is set for members of the group names[k], of at most 64.
        """
        for kind, cells, groups in zip(self._kinds, self._cells, self._groups):
            for first in range(0, len(cells), _PIECE):
                centroid, volume = measure(kind, self._points, cells[first : first + _PIECE])
                marks = np.zeros(len(volume), np.uint64)
                for bit, name in enumerate(names):
                    if name in groups:
                        marks |= groups[name][0][first : first + _PIECE].astype(np.uint64) << np.uint64(bit)
                yield centroid, volume, marks


def measure(kind, points, cells):
    """Return (centroid (n, dim) m, volume (n,) m^dim) of cells (n, corners) of a kind between points (n_points, dim), m. Local."""
    element = ELEMENTS[kind]
    at, weights = element.gauss
    centroid, volume = np.empty((len(cells), element.dim)), np.empty(len(cells))
    _measure(points, cells, element.shape(at), element.gradient(at), weights, centroid, volume)
    return centroid, volume


def compile_cells(dim):
    """Compile what a file of cells is read with. Local."""
    kind = {2: "quad", 3: "hexahedron"}[dim]
    points, cells = UNIT_CORNERS[kind].astype(float), np.arange(len(UNIT_CORNERS[kind]), dtype=np.int32)[None]
    _turn_round(kind, points, cells)
    measure(kind, points, cells)


def _check_size(path):
    """Raise a ValueError for a file that this machine cannot hold."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    size = path.stat().st_size if path.is_file() else 0
    if _TIMES_FILE * size > memory:
        raise ValueError(f"the mesh {path} has {size / 1e9:.3g} GB, and rank 0, which reads it whole, needs about {_TIMES_FILE} times that; this machine has {memory / 1e9:.3g} GB")


def _find_kinds(raw):
    """Return the kinds of cells of the highest dimension that the file holds."""
    kinds = {block.type for block in raw.cells if len(block.data)}
    other = sorted(kinds - {"vertex", "line", *DIM})
    allowed = f"a body is made of cells of the kinds {', '.join(sorted(DIM))}"
    if other:
        raise ValueError(f"has cells of kind {', '.join(other)}; {allowed}")
    found = sorted(kinds & set(DIM))
    if not found:
        raise ValueError(f"has no cells; {allowed}")
    dim = max(DIM[kind] for kind in found)
    return [kind for kind in found if DIM[kind] == dim]


def _find_tagged(raw, groups, number, dim):
    """Return {name: (vertices, [facets by kind])} of groups of lower dimension: vertices (n,) that cells touch, facets (n, corners) that they have."""
    tagged = {}
    for name, blocks in groups.items():
        vertices, facets = [], {}
        for block, marks in blocks.items():
            kind, data = raw.cells[block].type, number[np.asarray(raw.cells[block].data)[marks]]
            if kind in set(_FACET_KIND[each] for each in DIM if DIM[each] == dim):
                facets.setdefault(kind, []).append(data)
            elif DIM.get(kind, 0) < dim:
                vertices.append(data.ravel())
        if vertices or facets:
            tagged[name] = (np.concatenate(vertices) if vertices else np.empty(0, int)), {kind: np.concatenate(each) for kind, each in facets.items()}
    for name, chosen in raw.point_sets.items():
        if name not in tagged:
            tagged[name] = number[np.asarray(chosen, np.int64)], {}
    return tagged


def _members(kind, cells, place, blocks, groups, tagged, n_points):
    """Return {name: ((n,) bool, whether it is a group of cells)}: the cells of one kind that each group holds, or that touch it."""
    members = {}
    for name, chosen in groups.items():
        marked = np.concatenate([chosen.get(block, np.zeros(len(data), bool)) for block, data in blocks])
        if marked.any():
            held = np.zeros(len(cells), bool)
            held[place[marked]] = True
            members[name] = held, True
    for name, (vertices, facets) in tagged.items():
        if name in members:
            continue
        touched = np.zeros(n_points, bool)
        touched[vertices[vertices >= 0]] = True
        held = touched[cells].any(axis=1)
        if _FACET_KIND[kind] in facets:
            held |= _have_facets(cells[:, FACETS[kind]], facets[_FACET_KIND[kind]])
        if held.any():
            members[name] = held, False
    return members


def _have_facets(facets, wanted):
    """Return (n,) bool: which cells have one of the facets `wanted` (m, corners) among theirs, (n, n_facets, corners)."""
    flat = facets.reshape(-1, facets.shape[2])
    label = _label_rows(np.concatenate([flat, wanted]))
    return np.isin(label[: len(flat)], label[len(flat) :]).reshape(facets.shape[:2]).any(axis=1)


@kernel
def _measure(points, cells, shape, gradient, weights, centroid, volume):
    """Store volume = sum_q w |J| and centroid = sum_q w |J| x / volume of each cell by Gauss's points q, exact for cells with straight edges."""
    dim, corners = points.shape[1], cells.shape[1]
    jacobian = np.zeros((3, 3))
    for c in range(len(cells)):
        centroid[c], volume[c] = 0.0, 0.0
        for q in range(len(weights)):
            jacobian[:] = 0.0
            jacobian[2, 2] = 1.0
            for d in range(dim):
                for e in range(dim):
                    jacobian[d, e] = 0.0
                    for a in range(corners):
                        jacobian[d, e] += gradient[q, a, e] * (points[cells[c, a], d] - points[cells[c, 0], d])
            part = jacobian[0, 0] * (jacobian[1, 1] * jacobian[2, 2] - jacobian[1, 2] * jacobian[2, 1])
            part += jacobian[0, 1] * (jacobian[1, 2] * jacobian[2, 0] - jacobian[1, 0] * jacobian[2, 2])
            part += jacobian[0, 2] * (jacobian[1, 0] * jacobian[2, 1] - jacobian[1, 1] * jacobian[2, 0])
            part = weights[q] * abs(part)
            volume[c] += part
            for d in range(dim):
                for a in range(corners):
                    centroid[c, d] += part * shape[q, a] * (points[cells[c, a], d] - points[cells[c, 0], d])
        for d in range(dim):
            centroid[c, d] = points[cells[c, 0], d] + centroid[c, d] / volume[c]
