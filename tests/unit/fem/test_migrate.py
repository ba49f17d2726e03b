import numpy as np

from pdhpc.fem.mesh_file import FileMesh
from pdhpc.fem.migrate import migrate


def test_one_rank_takes_all(comm):
    """Two squares whose points stand at places 3 to 8 of the file; the second is glass, its right edge (place 1 in FACETS) loaded."""
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]], float)
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]], np.int32)
    sets = {"loaded": (np.array([1], np.int32), np.array([1], np.int32)), "nothing": (np.empty(0, np.int32), np.empty(0, np.int32))}
    share, regions, found = migrate(comm, FileMesh("quad", points, np.arange(3, 9), cells, {"glass": np.array([False, True])}, sets))
    assert share.kind == "quad" and np.array_equal(share.cells, cells) and share.cells.dtype == np.int32 and np.array_equal(share.points, points)
    assert share.cell_id.tolist() == [0, 1] and share.vertex_id.tolist() == [3, 4, 5, 6, 7, 8] and len(share.cell_owner) == len(share.vertex_owner) == 0
    assert regions["glass"].tolist() == [False, True] and found["loaded"].tolist() == [[2, 5]] and found["nothing"].shape == (0, 2)
