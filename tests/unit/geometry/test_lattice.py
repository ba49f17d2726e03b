import numpy as np

from pdhpc.geometry.lattice import LatticeBody, points_of_bodies
from pdhpc.geometry.shapes import Box, Disk

EVERYWHERE = (np.full(2, -np.inf), np.full(2, np.inf))


def test_a_box_is_filled_cell_by_cell():
    body = LatticeBody(Box((0.0, -1.0), (2.0, 1.0)), 0.5, 100)
    ids, points = body.points_in(*EVERYWHERE)
    assert ids.tolist() == list(range(100, 116)) and body.last_id == 116
    assert points[0].tolist() == [0.25, -0.75] and points[1].tolist() == [0.25, -0.25] and points[-1].tolist() == [1.75, 0.75]


def test_any_cut_into_parts_gives_the_same_particles_bit_for_bit():
    body = LatticeBody(Box((0.1, 0.2), (3.1, 2.0)), 0.1, 0, (Disk((1.0, 1.0), 0.4),))
    ids, points = body.points_in(*EVERYWHERE)
    cuts = [-np.inf, 0.7, 1.15, 1.15000001, np.inf]
    parts = [body.points_in(np.array([a, -np.inf]), np.array([b, np.inf])) for a, b in zip(cuts[:-1], cuts[1:])]
    assert np.array_equal(np.concatenate([p[0] for p in parts]), ids)
    assert np.array_equal(np.concatenate([p[1] for p in parts]), points)
    assert not Disk((1.0, 1.0), 0.4).contains(points).any() and len(ids) < 30 * 18


def test_large_bodies_are_made_in_slabs(monkeypatch):
    from pdhpc.geometry import lattice

    body = LatticeBody(Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), 0.1, 0)
    space = np.full(3, -np.inf), np.full(3, np.inf)
    whole = body.points_in(*space)
    monkeypatch.setattr(lattice, "_SLAB_POINTS", 150)
    pieces = body.points_in(*space)
    assert np.array_equal(whole[0], pieces[0]) and np.array_equal(whole[1], pieces[1])


def test_several_bodies_have_ascending_ids_and_their_number():
    first = LatticeBody(Box((0.0, 0.0), (1.0, 1.0)), 0.5, 0)
    second = LatticeBody(Box((1.0, 0.0), (2.0, 1.0)), 0.5, first.last_id)
    ids, points, number = points_of_bodies([first, second], *EVERYWHERE)
    assert ids.tolist() == list(range(8)) and number.tolist() == [0] * 4 + [1] * 4
    assert np.all(points[number == 1, 0] > 1.0)


def test_an_empty_box_of_space():
    body = LatticeBody(Box((0.0, 0.0), (1.0, 1.0)), 0.5, 0)
    ids, points = body.points_in(np.array([5.0, 5.0]), np.array([6.0, 6.0]))
    assert ids.shape == (0,) and points.shape == (0, 2)
