import itertools

import numpy as np
import pytest

from pdhpc.geometry.lattice import CommonLattice, LatticeBody, Slab, find_common_lattice
from pdhpc.geometry.shapes import Box
from pdhpc.kernels.simd import LANES
from pdhpc.peridynamics.grid import Grid


def slab_of(cell):
    """Return the Slab of one cell of a body that starts at the lattice's first."""
    return Slab(None, None, [(int(c), int(c) + 1) for c in cell], None)


def slots_of(grid, cells):
    """Return (n,) the slots of cells (n, dim), one by one."""
    return np.array([grid.slots(slab_of(cell), np.zeros(len(cell), np.int64))[0] for cell in cells], np.int32)


def owned_by(grid, cells):
    """Return (n,) bool, which cells (n, dim) the rank owns, one by one."""
    return np.array([grid.owns(slab_of(cell), np.zeros(len(cell), np.int64))[0] for cell in cells], bool)

EXTENTS = ((1, 1), (3, 17), (17, 3), (64, 62), (2, 3, 5), (5, 3, 2), (4, 4, 4), (10, 58, 9), (1, 1, 40), (3, 500), (4, 10, 50))  # the last two: rows of 512 slots, planes of 64 x 16


def lattice(dim):
    return CommonLattice(np.array([0.1, -0.2, 0.3][:dim]), 0.1, ())


def grid_of(extent, reach=3, first=7):
    first = np.arange(first, first + len(extent))
    return Grid(lattice(len(extent)), first, first + np.array(extent), reach)


def cells_of(grid, margin=0):
    """Return (n, dim), the owned cells and `margin` more on every side."""
    ranges = [np.arange(a - margin, b + margin) for a, b in zip(grid.first, grid.last)]
    return np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, len(ranges))


@pytest.mark.parametrize("extent, reach", list(itertools.product(EXTENTS, (2, 3))))
def test_every_cell_in_reach_has_a_slot_of_its_own_with_room_around(extent, reach):
    grid = grid_of(extent, reach)
    cells = cells_of(grid, reach)
    slots = slots_of(grid, cells)
    assert slots.dtype == np.int32 and len(set(slots.tolist())) == len(cells) and slots.min() >= 0 and slots.max() < grid.n_slots
    mine = owned_by(grid, cells)
    assert mine.sum() == np.prod(extent) and np.array_equal(cells[mine], cells_of(grid))
    row_ends = slots[mine].max() // LANES * LANES + LANES  # a block of eight starts at a multiple of eight and may reach past its row
    farthest = grid.offsets(np.stack(np.meshgrid(*[[-reach, reach]] * len(extent), indexing="ij"), axis=-1).reshape(-1, len(extent)))
    assert slots[mine].min() // LANES * LANES + farthest.min() >= 0 and row_ends + farthest.max() <= grid.n_slots


@pytest.mark.parametrize("extent", EXTENTS)
def test_the_longest_axis_is_the_fastest_and_rows_start_at_whole_blocks(extent):
    grid = grid_of(extent)
    dim = len(extent)
    assert extent[grid.fastest] == max(extent) and grid.step[grid.fastest] == 1
    slow = [axis for axis in range(dim) if axis != grid.fastest]
    assert all(grid.step[a] > grid.step[b] for a in slow for b in slow if extent[a] < extent[b])
    assert all(grid.step[axis] % LANES == 0 for axis in slow) and grid.n_slots % LANES == 0
    assert all(grid.step[axis] % 512 for axis in slow), "rows and planes a whole number of pages apart would share cache lines"
    rows = grid.rows(True)
    assert np.all(rows.start % LANES == 0) and np.all(np.diff(rows.start) >= rows.width) and rows.width == max(extent) and rows.axis == grid.fastest
    covered = (rows.start[:, None] + np.arange(rows.width)).ravel()
    assert sorted(covered.tolist()) == sorted(slots_of(grid, cells_of(grid)).tolist())


@pytest.mark.parametrize("extent", EXTENTS)
def test_neighbours_lie_at_constant_offsets(extent):
    grid, random = grid_of(extent), np.random.default_rng(1)
    stencil = random.integers(-3, 4, (20, len(extent)))
    cells = cells_of(grid)[:50]
    for offset, xi in zip(grid.offsets(stencil), stencil):
        assert np.array_equal(slots_of(grid, cells) + offset, slots_of(grid, cells + xi))


@pytest.mark.parametrize("dim", (2, 3))
def test_coordinates_are_those_of_the_body_to_the_last_bit(dim):
    cells = (37, 11, 5)[:dim]
    body = LatticeBody(Box((0.1, -0.7, 0.3)[:dim], tuple(x + 0.1 * n for x, n in zip((0.1, -0.7, 0.3), cells))), 0.1, 0)
    common, _ = find_common_lattice([body])
    grid = Grid(common, np.full(dim, 2), np.array(cells) - 1, 2)
    for axis in range(dim):
        inside = slice(grid.pad[axis] - 2, grid.pad[axis] + cells[axis] - 2)  # cell 0 of the body lies two before the first
        assert np.array_equal(grid.coordinate[axis, inside], body.centres(axis))
    rows, owned = grid.rows(True), cells_of(grid)
    places = np.stack([body.centres(axis)[owned[:, axis]] for axis in range(dim)], axis=1)
    by_slot = {slot: place.tolist() for slot, place in zip(slots_of(grid, owned).tolist(), places)}
    for start, corner in zip(rows.start.tolist(), rows.corner):
        for n, along in enumerate(rows.along):
            place = corner.copy()
            assert place[rows.axis] == 0.0
            place[rows.axis] = along
            assert by_slot[start + n] == place.tolist()


def test_bounds_lie_between_cells():
    lower, upper = grid_of((5, 3), reach=2).bounds()  # cells 7 ... 11 and 8 ... 10 of a lattice of side 0.1 from (0.1, -0.2)
    assert lower == pytest.approx([0.1 + 0.5, -0.2 + 0.6]) and upper == pytest.approx([0.1 + 1.4, -0.2 + 1.3])


@pytest.mark.parametrize("dim", (2, 3))
def test_a_rank_that_owns_nothing_has_an_empty_grid(dim):
    grid = Grid(lattice(dim), np.zeros(dim, np.int64), np.zeros(dim, np.int64), 3)
    rows = grid.rows(True)
    assert len(rows.start) * rows.width == 0 and grid.n_slots < 3000 and not owned_by(grid, np.zeros((1, dim), np.int64)).any()
