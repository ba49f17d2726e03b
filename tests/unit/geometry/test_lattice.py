import numpy as np
import pytest

from pdhpc.geometry.lattice import LatticeBody, find_common_lattice, points_of_bodies
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


def test_slabs_number_their_particles_by_cells():
    body = LatticeBody(Box((0.1, -1.0, 3.0), (0.8, -0.5, 3.3)), 0.1, 1000, (Box((0.3, -0.8, 3.0), (0.5, -0.6, 3.3)),))
    ids, points = body.points_in(np.full(3, -np.inf), np.full(3, np.inf))
    slabs = list(body.slabs_in(np.full(3, -np.inf), np.full(3, np.inf)))
    cells = np.stack([np.concatenate([slab.number(np.eye(3, dtype=int)[axis], 0) for slab in slabs]) for axis in range(3)], axis=1)
    assert np.array_equal(points, np.stack([body.centres(axis)[cells[:, axis]] for axis in range(3)], axis=1))
    assert np.all(cells >= 0) and np.all(cells < body.cells) and len(np.unique(cells, axis=0)) == len(ids) < 7 * 5 * 3
    assert np.array_equal(ids, 1000 + cells @ [15, 3, 1])  # the last axis runs fastest
    inside = np.concatenate([slab.within([1, 0, 0], [3, 5, 2]) for slab in slabs])
    assert np.array_equal(inside, ((cells >= [1, 0, 0]) & (cells < [3, 5, 2])).all(axis=1))


def test_ranges_of_cells_hold_their_lower_and_not_their_upper_bound():
    body = LatticeBody(Box((0.0, 0.0), (4.0, 2.0)), 0.5, 0)
    assert body.cells_in(np.array([0.75, -np.inf]), np.array([1.75, np.inf])) == [(1, 3), (0, 4)]  # centres 0.25, 0.75, 1.25, 1.75, ...
    assert body.cells_in(np.array([9.0, 0.0]), np.array([10.0, 0.1])) == [(8, 8), (0, 0)]


def on_lattice(*corners, spacing=0.1, side=1.0):
    """Bodies with these lower corners."""
    return [LatticeBody(Box(tuple(corner), tuple(x + side for x in corner)), spacing, 1000 * n) for n, corner in enumerate(corners)]


def test_one_body_is_its_own_lattice():
    body = on_lattice((0.3, -0.7))[0]
    common, reason = find_common_lattice([body])
    assert reason is None and common.shifts[0].tolist() == [0, 0] and common.spacing == 0.1
    for axis in range(2):
        assert np.array_equal(common.centre(axis, 0, 10), body.centres(axis)) and np.array_equal(common.centre(axis, 3, 5), body.centres(axis)[3:5])


def test_bodies_whole_spacings_apart_share_a_lattice():
    first, second = on_lattice((0.3, -0.7), (-12.3, 0.1))  # 126 and 8 spacings, neither exact in doubles
    common, reason = find_common_lattice([first, second])
    assert reason is None and common.shifts[1].tolist() == [-126, 8]
    assert np.allclose(common.centre(0, -126, -116), second.centres(0), atol=1e-14)


@pytest.mark.parametrize("corner, words", [
    ((0.35, 0.0), "body 2 lies +0.500 spacings along x off the lattice of body 1"),
    ((0.3, 1.025), "body 2 lies +0.250 spacings along y off the lattice of body 1"),
    ((0.31, 0.98), "body 2 lies -0.200 spacings along y off the lattice of body 1"),  # the axis that is off most
    ((0.3, 0.10001), "body 2 lies +0.000 spacings along y off the lattice of body 1"),  # 1e-4 spacings
])
def test_bodies_between_the_cells_of_another_do_not(corner, words):
    assert find_common_lattice(on_lattice((0.0, 0.0), corner)) == (None, words)


def test_the_third_of_several_bodies_is_named():
    assert find_common_lattice(on_lattice((0.0, 0.0), (3.0, 0.0), (6.05, 0.0)))[1].startswith("body 3 lies ")


def test_round_off_does_not_part_bodies():
    assert find_common_lattice(on_lattice((0.0, 0.0), (0.3 + 5e-8, 0.0)))[1] is None  # 5e-7 spacings
    assert find_common_lattice(on_lattice((0.0, 0.0), (0.3 + 5e-7, 0.0)))[0] is None


def test_disks_are_anchored_at_their_bounding_boxes():
    disk, box = LatticeBody(Disk((1.0, 1.0), 0.35), 0.1, 0), LatticeBody(Box((2.0, 0.0), (3.0, 1.0)), 0.1, 100)
    assert find_common_lattice([disk, box])[1].startswith("body 2 lies ")
    assert find_common_lattice([LatticeBody(Disk((1.0, 1.0), 0.3), 0.1, 0), box])[1] is None


@pytest.mark.parametrize("coordinate", (-0.199, -0.15, -0.101))
def test_planes_before_and_after_a_layer(coordinate):
    """The layer of cells around -0.15 m lies between -0.2 m and -0.1 m, wherever in it the coordinate is."""
    common, _ = find_common_lattice(on_lattice((0.3, -0.7)))
    assert common.between(1, coordinate, False) == pytest.approx(-0.2, abs=1e-15)
    assert common.between(1, coordinate, True) == pytest.approx(-0.1, abs=1e-15)


def test_planes_part_the_layers_of_cells_far_from_the_origin():
    """At 1e9 spacings from the origin, as far as scenes may lie, round-off moves no cell over a plane."""
    common, _ = find_common_lattice(on_lattice((1e8, -1e8)))
    for axis in (0, 1):
        centres = common.centre(axis, 0, 10)
        planes = np.array([common.between(axis, centre, True) for centre in centres])
        assert np.all(centres < planes) and np.all(planes[:-1] < centres[1:])
