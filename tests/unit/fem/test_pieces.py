import numpy as np
import pytest

from pdhpc.fem import pieces as module
from pdhpc.fem.basis import Hats
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.pieces import find_free_piece, find_pieces
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh


def diagonal(x):
    """Cells of a unit box along its diagonal: those whose centres have equal coordinates."""
    return np.ptp(x, axis=1) < 1e-9


def free_of(mesh, held, basis=None):
    """The FreePiece when the unknowns that function x (n, dim), m -> (n, width) bool chooses are prescribed."""
    return find_free_piece(basis or Hats(mesh.kind), mesh, find_pieces(mesh), held(mesh.points[: mesh.n_owned]))


def at(*places):
    """Function for free_of: all unknowns of the vertices at these places."""
    return lambda x: np.repeat((np.abs(x[:, None] - np.array(places)) < 1e-9).all(axis=2).any(axis=1)[:, None], x.shape[1], axis=1)


def test_cells_with_common_facets_are_one_piece(comm):
    assert find_pieces(box_mesh(comm, (3, 2))).count == 1 and find_pieces(general_mesh(comm, "tetra", (2, 2, 2), 0.1)).count == 1
    found = find_pieces(box_mesh(comm, (3, 2), (1.0, 1.0), keep=lambda x: np.abs(x[:, 0] - 0.5) > 0.2))
    assert found.count == 2 and found.number.tolist() == [0, 0, 1, 1] and found.first.tolist() == [0, 4]  # ids count the cells that are left out
    assert find_pieces(box_mesh(comm, (3, 3), (1.0, 1.0), keep=diagonal)).number.tolist() == [0, 1, 2]


@pytest.mark.parametrize("counts, keep, motions", [
    ((2, 2), diagonal, 1),  # about the vertex
    ((2, 2, 2), diagonal, 3),  # about the vertex, around all axes
    ((2, 2, 1), lambda x: diagonal(x[:, :2]), 1),  # around the edge
    ((3, 3, 1), lambda x: np.abs(x[:, 0] - 0.5) > 0.2, 6),  # apart
])
def test_what_pieces_share_leaves_some_motions(comm, counts, keep, motions):
    found = free_of(box_mesh(comm, counts, (1.0,) * len(counts), keep=keep), lambda x: np.repeat(x[:, :1] < 0.1, len(counts), axis=1))
    assert (found.motions, found.others) == (motions, 0) and found.place[0] > 0.5


def test_a_hinged_arch_stands_unless_its_hinges_are_in_line(comm):
    """Two squares with a common vertex, each held in another one: the three hinges in a triangle leave nothing free, in a line a first small motion."""
    mesh = box_mesh(comm, (2, 2), (1.0, 1.0), keep=diagonal)
    assert free_of(mesh, at((0.5, 0.0), (1.0, 0.5))) is None
    found = free_of(mesh, at((0.0, 0.0), (1.0, 1.0)))
    assert (found.motions, found.others) == (1, 1) and found.place == pytest.approx([0.25, 0.25])
    assert free_of(mesh, at((0.5, 0.0)))[1:] == (1, 1)  # a double pendulum


@pytest.mark.parametrize("dim, motions", [(2, 3), (3, 6)])
def test_a_ring_of_three_is_as_stiff_as_a_body(comm, dim, motions):
    """A hook of seven cells and two more, with three hinges in a triangle, moves as one, held or not; in 3D the hinges are edges, which hold more than they must."""
    hook = {(0, 1), (0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2)}

    def keep(x):
        return np.array([tuple(each) in hook | {(1, 2), (2, 3)} for each in np.floor(x[:, :2]).astype(int).tolist()], bool)

    mesh = box_mesh(comm, (4, 4, 1)[:dim], (4.0, 4.0, 1.0)[:dim], keep=keep)
    assert free_of(mesh, lambda x: np.repeat(x[:, :1] < 0.1, dim, axis=1)) is None
    assert free_of(mesh, lambda x: np.zeros(x.shape, bool))[1:] == (motions, 2)


def test_a_chain_hangs_from_its_neighbours(comm, monkeypatch):
    """Three squares along a diagonal: two held ends hold the middle one by its two hinges; looked at one by one, each has what it needs beside it."""
    mesh = box_mesh(comm, (3, 3), (1.0, 1.0), keep=diagonal)
    ends = lambda x: np.repeat((x < 0.1).any(axis=1)[:, None] | (x > 0.9).any(axis=1)[:, None], 2, axis=1)  # noqa: E731
    assert free_of(mesh, ends) is None and free_of(mesh, at((0.0, 0.0), (0.0, 1 / 3))).others == 1
    monkeypatch.setattr(module, "_MOST", 0)
    assert free_of(mesh, ends) is None and free_of(mesh, at((0.0, 0.0), (0.0, 1 / 3))).place == pytest.approx([5 / 6, 5 / 6])  # the middle one has held neighbours


@pytest.mark.parametrize("far", (0.0, 1e6))
def test_flat_tops_share_their_slopes(comm, far):
    """A common vertex holds gradients too where functions are linear at it; where the body stands does not matter."""
    mesh = box_mesh(comm, (2, 2), (1.0, 1.0), keep=diagonal)
    mesh.points += far
    held = mesh.points[:, 0] - far < 0.1
    assert find_free_piece(FlatTop("quad"), mesh, find_pieces(mesh), np.repeat(held[:, None], 6, axis=1)) is None
    assert find_free_piece(Hats("quad"), mesh, find_pieces(mesh), np.repeat(held[:, None], 2, axis=1)).motions == 1


def test_a_torn_mesh_is_as_many_pieces(comm):
    """Nine cells without common vertices, one of them held."""
    mesh = box_mesh(comm, (5, 5), (1.0, 1.0), keep=lambda x: (np.rint(5 * x - 0.5) % 2 == 0).all(axis=1))
    found = free_of(mesh, at((0.0, 0.0), (0.0, 0.2)))
    assert find_pieces(mesh).count == 9 and (found.motions, found.others) == (3, 7) and found.place == pytest.approx([0.1, 0.5])
