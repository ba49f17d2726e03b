"""The pieces of a mesh, cells that hang together by facets, and which rigid motions of each its supports leave free.

Pieces that meet at a vertex, or in 3D along an edge, can turn against each other: what they share are conditions between their rigid motions.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.fem.basis import rigid_motions, turns
from pdhpc.fem.facets import find_neighbours
from pdhpc.jit import kernel

_RANK = 1e-12  # of the largest eigenvalue of what holds pieces: below, a motion is free
_NOTHING = 1e-300  # for the largest eigenvalue of a piece that nothing holds
_TAKES_PART = 1e-6  # of a free motion of pieces that hold each other: a piece with less of it stands still
_MOST = 1500  # motions of pieces that hold each other, up to which they are looked at together


class Pieces(NamedTuple):
    """The pieces of a mesh, numbered by the smallest id of their cells: count of all ranks, number (n_cells,) int64 of each local cell, first (count,) that id."""

    count: int
    number: np.ndarray
    first: np.ndarray


class FreePiece(NamedTuple):
    """A piece that supports leave free: place (dim,), m, the centre of one of its cells; motions, the number of its free rigid motions; others, free pieces beside it."""

    place: np.ndarray
    motions: int
    others: int


def find_pieces(mesh):
    """Return the Pieces of a mesh. Collective; a round of messages for each time that the longest way through a piece changes ranks."""
    if mesh.counts is not None and mesh.n_global_cells == np.prod(mesh.counts):
        return Pieces(1, np.zeros(len(mesh.cells), np.int64), np.zeros(1, np.int64))
    here = np.empty(len(mesh.cells), np.int64)
    _join(find_neighbours(mesh.kind, mesh.cells, len(mesh.cells), len(mesh.points)), here)
    label = mesh.cell_id.copy()[:, None]
    ghosts, lowest = mesh.cell_exchange.bind(label), np.full(len(label), np.iinfo(np.int64).max)
    changed = True
    while changed:
        np.minimum.at(lowest, here, label[:, 0])
        before, label[:, 0] = label[:, 0].copy(), lowest[here]
        changed = mesh.comm.allreduce(int((label[:, 0] != before).any())) > 0
        ghosts.refresh()
    ghosts.free()
    mine = label[: mesh.n_owned_cells, 0]
    first = np.unique(np.concatenate(mesh.comm.allgather(mine[mine == mesh.cell_id[: mesh.n_owned_cells]])))
    return Pieces(len(first), np.searchsorted(first, label[:, 0]), first)


@kernel
def _join(neighbours, here):
    """Store in here (n,) the smallest cell that each cell hangs together with; neighbours (n, n_facets), -1 where there is none."""
    for cell in range(len(here)):
        here[cell] = cell
    for cell in range(len(here)):
        for other in neighbours[cell]:
            if other >= 0:
                a, b = cell, np.int64(other)
                while here[a] != a:
                    here[a] = here[here[a]]
                    a = here[a]
                while here[b] != b:
                    here[b] = here[here[b]]
                    b = here[b]
                here[max(a, b)] = min(a, b)
    for cell in range(len(here)):
        here[cell] = here[here[cell]]


def find_free_piece(basis, mesh, pieces, fixed):
    """Return the FreePiece with the smallest number, or None where no rigid motion of any piece is free. Collective.

    A piece p moves as u = R_p a_p. Prescribed components ask for R_p a_p = 0, a vertex of the pieces p and q for R_p a_p = R_q a_q; free is what is left.
    Of more than 1500 motions of pieces that hold each other each piece counts as held that would be if those beside it were.

    basis : of the cells. fixed (n_owned, width) bool : the prescribed unknowns of owned vertices.
    """
    own, pairs, between = _conditions(basis, mesh, pieces, fixed)
    eigenvalues = np.linalg.eigvalsh(own)
    free = np.count_nonzero(~(eigenvalues > _RANK * np.maximum(eigenvalues[:, -1:], _NOTHING)), axis=1)
    for group in _groups(pieces.count, pairs):
        if len(group) * own.shape[1] <= _MOST:
            inside = np.flatnonzero(np.isin(pairs[:, 0], group))
            free[group] = _free_together(own[group], np.searchsorted(group, pairs[inside]), between[inside])
    loose = np.flatnonzero(free)
    if len(loose) == 0:
        return None
    cell = np.flatnonzero(mesh.cell_id[: mesh.n_owned_cells] == pieces.first[loose[0]])
    place = mesh.comm.allreduce(mesh.points[mesh.cells[cell]].mean(axis=1).sum(axis=0))
    return FreePiece(place, int(free[loose[0]]), len(loose) - 1)


def _conditions(basis, mesh, pieces, fixed):
    """Return (own (count, m, m), pairs (n, 2), between (n, m, m)): the squares sum |R_p a_p|^2 + sum |R_p a_p - R_q a_q|^2 of all conditions. Collective.

    own are their matrices in a_p alone, between those of a_p and a_q of the pairs (p, q). Turns are around the middle of a piece, by its size.
    """
    vertex, piece = _incidences(mesh, pieces)
    middle, size = _middles(mesh, pieces.count, vertex, piece)
    again = np.concatenate([[False], vertex[1:] == vertex[:-1]])
    asked = fixed[vertex].any(axis=1) | again | np.roll(again, -1)
    vertex, piece = vertex[asked], piece[asked]
    moves = _motions_of_pieces(basis, mesh, vertex, middle[piece], size[piece])
    own = np.zeros((pieces.count, moves.shape[2], moves.shape[2]))
    held = moves * fixed[vertex][:, :, None]
    np.add.at(own, piece, np.einsum("nwa,nwb->nab", held, held))
    first = np.flatnonzero(vertex[1:] == vertex[:-1])
    for side in (first, first + 1):
        np.add.at(own, piece[side], np.einsum("nwa,nwb->nab", moves[side], moves[side]))
    between = -np.einsum("nwa,nwb->nab", moves[first], moves[first + 1])
    pairs = np.stack([piece[first], piece[first + 1]], axis=1)
    pairs, between = (np.concatenate(each) for each in zip(*mesh.comm.allgather((pairs, between))))
    return mesh.comm.allreduce(own), pairs, between


def _incidences(mesh, pieces):
    """Return (vertex (n,), piece (n,)): which owned vertices belong to which pieces, by vertex, then by piece. Local."""
    if pieces.count == 1:
        return np.arange(mesh.n_owned), np.zeros(mesh.n_owned, np.int64)
    keys = (mesh.cells * np.int64(pieces.count) + pieces.number[:, None]).ravel()
    return np.divmod(np.unique(keys[keys < mesh.n_owned * pieces.count]), pieces.count)


def _middles(mesh, count, vertex, piece):
    """Return (middle (count, dim), m, size (count,), m, the root of the mean square of distances from it) of the pieces' vertices. Collective."""
    x = mesh.points[vertex]

    def sums(values):
        return mesh.comm.allreduce(np.bincount(piece, values, count))

    number = sums(np.ones(len(piece)))
    middle = np.stack([sums(x[:, axis]) for axis in range(mesh.dim)], axis=1) / number[:, None]
    return middle, np.sqrt(sums(np.square(x - middle[piece]).sum(axis=1)) / number)


def _motions_of_pieces(basis, mesh, vertex, middle, size):
    """Return (n, width, m), m = 3 or 6: R of each vertex and piece, with turns around the piece's middle (n, dim), by its size (n,). Local."""
    dim = mesh.dim
    moves = rigid_motions(basis, mesh)[vertex]
    shift = np.einsum("tab,nb->nat", turns(dim), middle)  # of a turn around the origin, at the middle
    moves[:, :, dim:] -= np.einsum("nwa,nat->nwt", moves[:, :, :dim], shift)
    moves[:, :, dim:] /= size[:, None, None]
    return moves


def _groups(count, pairs):
    """Return [(n,) ascending] of the pieces that pairs (n, 2) join to others. Local."""
    label, before = np.arange(count), None
    while before is None or not np.array_equal(label, before):
        before, lowest = label.copy(), label[pairs].min(axis=1)
        for side in (0, 1):
            np.minimum.at(label, pairs[:, side], lowest)
    members = np.unique(pairs)
    members = members[np.argsort(label[members], kind="stable")]
    return np.split(members, np.flatnonzero(np.diff(label[members])) + 1) if len(members) else []


def _free_together(own, pairs, between):
    """Return (n,) the number of free motions of each of n pieces that hold each other, from the null space of their matrix. Local."""
    n, size = own.shape[:2]
    scale = 1.0 / np.sqrt(np.trace(own, axis1=1, axis2=2))
    matrix = np.zeros((n, n, size, size))
    matrix[np.arange(n), np.arange(n)] = own
    np.add.at(matrix, tuple(pairs.T), between)
    np.add.at(matrix, tuple(pairs.T[::-1]), between.transpose(0, 2, 1))
    matrix *= (scale[:, None] * scale)[:, :, None, None]
    eigenvalues, vectors = np.linalg.eigh(matrix.transpose(0, 2, 1, 3).reshape(n * size, n * size))
    null = vectors[:, ~(eigenvalues > _RANK * eigenvalues[-1])].reshape(n, size, -1)
    return np.linalg.matrix_rank(null, tol=_TAKES_PART)
