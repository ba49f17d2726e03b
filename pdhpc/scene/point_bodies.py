"""Scene -> the bodies whose particles stand in files: read on rank 0, dealt out in equal pieces, then sent to the ranks in reach of them."""
from dataclasses import replace
from pathlib import Path

import numpy as np

from pdhpc.geometry.points import PointBody
from pdhpc.geometry.table_file import TableFile
from pdhpc.parallel.comm import exact_sum, largest, smallest
from pdhpc.parallel.travel import send_rows, share_pieces
from pdhpc.scene.sections import section
from pdhpc.scene.sentences import nearest

_EQUAL = 1e-9  # relative: cells whose volumes differ by less, through round-off, get the same one, as rows of equal volumes are the fast ones
_NAMED = 20  # groups that a sentence lists
_SAME = 0.9  # least ratio of sizes and spacing for which the linear volume correction is meant


class _Rows:
    """This rank's piece of the rows of one file: number (n,) int64; points (n, dim), m; volume (n,), m^3; marks (n,) uint64, by the names used.

    count : rows of the whole file. repeated : cells that were left out, see mesh_file.count_repeated. names : the groups used. known : the names of all groups, of cells and others.
    """

    def __init__(self, dim, names):
        self.number, self.points, self.volume, self.marks = np.empty(0, np.int64), np.empty((0, dim)), np.empty(0), np.empty(0, np.uint64)
        self.names, self.count, self.known, self.repeated = names, 0, ([], []), 0


class PointFiles:
    """The files of a scene's bodies, each read once.

    Rank 0 holds a mesh file whole while it is dealt out (fem/cell_points.py); of a table 4 MB of text at a time. Then every rank holds n / size rows of
    8 dim + 24 bytes.
    """

    def __init__(self, scene, comm):
        """Read and deal out. Collective.

        Raises
        ------
        SceneError, on every rank: a file that cannot be read or does not fit the scene, or a region of a group that no file has.
        """
        self.scene, self.comm, self.rows = scene, comm, {}
        for number, body in enumerate(scene.body):
            if body.file is not None and (body.shape, body.file) not in self.rows:
                self.rows[body.shape, body.file] = _read(scene, comm, number, _names_used(scene, body.shape, body.file))
        known = list(dict.fromkeys(name for rows in self.rows.values() for names in rows.known for name in names))
        for region in scene.region:
            if region.shape == "group" and region.group not in known:
                raise scene.error(f"region '{region.name}': group", f'"{region.group}"', f"a group of the bodies' files ({_listed(known)}){nearest(region.group, known)}")

    def remarks(self):
        """Return sentences on what the files hold and bodies do not. Local, the same on every rank."""
        found = [sentence for (_, file), rows in self.rows.items() for sentence in repetitions(file, rows.repeated)]
        return found + [sentence for (shape, file), rows in self.rows.items() if shape == "table" for sentence in self._left_out(file, rows.known[0])]

    def _left_out(self, file, blocks):
        """Return [a sentence] on blocks of a table that no body takes."""
        taken = {_group_of(body) for body in self.scene.body if (body.shape, body.file) == ("table", file)}
        left = [] if None in taken else [block for block in blocks if block not in taken]
        return [f"{file}: rows of block{'s' if len(left) > 1 else ''} {_listed(left)} are in no body"] if left else []

    def body(self, number, first_id):
        """Return the PointBody of a body, each rank with an equal piece of its points; ids from `first_id` on. Collective.

        Raises
        ------
        SceneError, on every rank: a group or block that the file does not have; a horizon or volume correction that does not go with the sizes of particles.
        """
        body = self.scene.body[number]
        made = _take(self.scene, self.comm, number, self.rows[body.shape, body.file], first_id)
        _check_sizes(self.scene, number, made)
        return made


def repetitions(file, count):
    """Return [a sentence] on cells of a file that stand there more than once without a group of their own; [] for none."""
    return [] if not count else [f"{file}: {count:,} cell{'s stand' if count > 1 else ' stands'} there again, with the same corners and groups, and count{'' if count > 1 else 's'} once"]


def _listed(names):
    """Return names as a sentence lists them."""
    return ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "") or "none is there"


def bit_of(scene, body, name):
    """Return the uint64 that marks the members of a group in a body's file, 0 where the scene does not use it there. Local."""
    names = _names_used(scene, body.shape, body.file)
    return np.uint64(1 << names.index(name)) if name in names else np.uint64(0)


def _names_used(scene, shape, file):
    """Return the names of the groups of a file that its bodies and the scene's regions name."""
    own = [_group_of(body) for body in scene.body if (body.shape, body.file) == (shape, file)]
    return list(dict.fromkeys([name for name in own if name is not None] + [region.group for region in scene.region if region.shape == "group"]))


def _group_of(body):
    """Return the name of the group, or the number of the block, that makes a body; None for all of its file."""
    if body.shape == "mesh":
        return body.group
    return None if body.block is None else str(body.block)


def _read(scene, comm, number, names):
    """Return this rank's _Rows of the file of a body. Collective."""
    body, rows = scene.body[number], _Rows(scene.dim, names)
    path = Path(scene.source).parent / body.file
    key, size = f"{section('body', number, body)}: file", scene.thickness if scene.dim == 2 else 1.0
    allowed = "a table of points" if body.shape == "table" else "a mesh of triangles, quads, tetrahedra or hexahedra that meshio reads"
    parts = []
    try:
        if body.shape == "mesh":
            pieces = _cell_pieces(path, scene, names, rows)
        else:
            pieces = _table_pieces(path, scene.dim, names, rows)
        for first, (points, volume, marks) in share_pieces(comm, pieces):
            parts.append((first + np.arange(len(points)), points, volume * size if body.shape == "mesh" else volume, marks))
    except ValueError as error:
        raise scene.error(key, f'"{body.file}" ({error})', f"{allowed}, named from the folder of the scene") from error
    rows.count, rows.known, rows.repeated = comm.bcast((rows.count, rows.known, rows.repeated))
    if parts:
        rows.number, rows.points, rows.volume, rows.marks = (np.concatenate(part) for part in zip(*parts))
    return rows


def _cell_pieces(path, scene, names, rows):
    """Yield the (points, volume, marks) of a mesh file; rank 0."""
    from pdhpc.fem.cell_points import CellFile

    file = CellFile(path)
    if file.dim != scene.dim:
        raise ValueError(f'the mesh {path} has cells of {file.dim} dimensions; dimension = "{scene.dimension}" asks for {scene.dim}')
    rows.repeated = file.repeated
    rows.count, rows.known = file.count, (file.cell_groups, [name for name in file.groups if name not in file.cell_groups])
    yield from file.pieces(names)


def _table_pieces(path, dim, names, rows):
    """Yield the (points, volume, marks) of a table; rank 0."""
    file = TableFile(path, dim)
    for points, volume, block in file.pieces():
        marks = np.zeros(len(block), np.uint64)
        for bit, name in enumerate(names):
            if name.lstrip("-").isdigit():
                marks |= (block == int(name)).astype(np.uint64) << np.uint64(bit)
        rows.count, rows.known = file.count, ([str(each) for each in sorted(file.blocks)], [])
        yield points, volume, marks


def _take(scene, comm, number, rows, first_id):
    """Return the PointBody of a body from the rows of its file. Collective."""
    body, where, name = scene.body[number], section("body", number, scene.body[number]), _group_of(scene.body[number])
    chosen = slice(None)
    if name is not None:
        cells, others = rows.known
        if name not in cells:
            kind, key = ("block", "block") if body.shape == "table" else ("group of cells", "group")
            found = f'"{name}", which is a group of points or facets' if name in others else f'"{name}"'
            raise scene.error(f"{where}: {key}", found, f"a {kind} of {body.file} ({_listed(cells)}){nearest(name, cells)}")
        chosen = (rows.marks & bit_of(scene, body, name)) != 0
    ids, points, volume = rows.number[chosen] + first_id, rows.points[chosen], rows.volume[chosen]
    count, thickness = comm.allreduce(len(ids)), scene.thickness if scene.dim == 2 else 1.0
    mean = exact_sum(comm, volume) / count
    volumes = smallest(comm, volume.min(initial=np.inf)), mean, largest(comm, volume.max(initial=0.0))
    if body.shape == "mesh" and volumes[2] - volumes[0] <= _EQUAL * mean:
        volume, volumes = np.full(len(ids), mean), (mean, mean, mean)
    sizes = tuple((each / thickness) ** (1 / scene.dim) for each in volumes)
    lower = np.array([smallest(comm, points[:, axis].min(initial=np.inf)) for axis in range(scene.dim)])
    upper = np.array([largest(comm, points[:, axis].max(initial=-np.inf)) for axis in range(scene.dim)])
    return PointBody(first_id, first_id + rows.count, count, ids, points, volume, rows.marks[chosen], lower, upper, sizes)


def spread(comm, body, partition, reach, first=0):
    """Return a PointBody whose ranks hold the points of their boxes grown by `reach`, m, and of its window. Collective.

    body : each point on exactly one rank. partition : whose leaf k is rank first + k.
    """
    inside = np.ones(len(body.id), bool) if body.window is None else body.window.contains(body.points)
    rows = np.flatnonzero(inside)
    row, rank = partition.ranks_near(body.points[rows], reach)
    row = rows[row]
    ids, points, volume, marks = send_rows(comm, rank + first, [body.id[row], body.points[row], body.volume[row], body.marks[row]])
    order = np.argsort(ids, kind="stable")
    return replace(body, id=ids[order], points=points[order], volume=volume[order], marks=marks[order])


def _check_sizes(scene, number, found):
    """Raise a SceneError for a horizon or a volume correction that does not go with the sizes of a PointBody's particles. Local, the same on every rank."""
    setting, body, (small, mean, large) = scene.particles, scene.body[number], found.sizes
    where, horizon = section("body", number, body), setting.horizon if body.horizon is None else body.horizon
    if horizon < 2 * mean * (1 - 1e-6):
        allowed = f"at least twice the mean size of the particles of {where}, {2 * mean:.6g} m (size: side of a square or cube of the same volume)"
        raise scene.error("particles.horizon" if body.horizon is None else f"{where}: horizon", horizon, allowed)
    corrected = setting.volume_correction == "linear" and setting.influence != "conical"
    if corrected and not _SAME * setting.spacing <= small <= large <= setting.spacing / _SAME:
        words = f'"linear", while the particles of {where} are {small:.6g} to {large:.6g} m in size and particles.spacing is {setting.spacing:g} m'
        allowed = '"none", which knows no spacing (pmb: with surface_correction = "energy", which goes by families as they are); "linear" is for particles '
        raise scene.error("particles.volume_correction", words, f"{allowed}within a tenth of particles.spacing")
