import numpy as np
import pytest

from pdhpc.gfem.enriched_cells import EnrichedCells


def test_stars_list_cells_and_neighbours(comm, cracked_box):
    """One vertex inside: 4 cells; its own star has all four and 9 neighbours, that of a corner of the patch one cell and 4."""
    case = cracked_box(comm, (4, 4), inside=lambda x: (x == 2.0).all(axis=1))
    cells = EnrichedCells(case.mesh, case.points)
    stars = cells.stars
    assert cells.n_owned == 4 and len(stars.vertex) == 9 and np.diff(stars.start).tolist() == [1, 2, 1, 2, 4, 2, 1, 2, 1]
    assert np.diff(stars.first).tolist() == [4, 6, 4, 6, 9, 6, 4, 6, 4]
    for i, vertex in enumerate(stars.vertex):
        for k in range(stars.start[i], stars.start[i + 1]):
            assert cells.corners[stars.cell[k], stars.corner[k]] == vertex
            assert np.array_equal(stars.neighbour[stars.first[i] + stars.slot[k]], cells.corners[stars.cell[k]])
        around = stars.neighbour[stars.first[i] : stars.first[i + 1]]
        assert np.all(np.diff(case.mesh.vertex_id[around]) > 0)


def test_cells_without_points_are_left_out(comm, cracked_box):
    case = cracked_box(comm, (4, 4), inside=lambda x: (x == 2.0).all(axis=1))
    points = case.points._replace(start=np.array([0, 16, 16, 32, 48]))
    cells = EnrichedCells(case.mesh, points)
    assert np.array_equal(cells.corners, case.mesh.cells[points.cell[[0, 2, 3]]]) and cells.start.tolist() == [0, 16, 32, 48]


def test_cells_must_ascend(comm, cracked_box):
    case = cracked_box(comm)
    with pytest.raises(ValueError, match="ascending"):
        EnrichedCells(case.mesh, case.points._replace(cell=case.points.cell[::-1]))


def test_no_cell(comm, cracked_box):
    cells = EnrichedCells(*(lambda case: (case.mesh, case.points))(cracked_box(comm, inside=lambda x: np.zeros(len(x), bool))))
    assert cells.n_owned == 0 and len(cells.stars.vertex) == 0 and cells.stars.first.tolist() == [0]
