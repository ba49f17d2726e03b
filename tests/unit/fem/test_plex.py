import ctypes

import numpy as np
import pytest

from pdhpc.fem.facets import UNIT_CORNERS
from pdhpc.fem.plex import PLEX_CORNERS, build_plex, call_petsc
from pdhpc.fem.share import Share
from pdhpc.parallel.ghosts import GhostExchange

MEASURE = {"triangle": 1 / 2, "quad": 1.0, "tetra": 1 / 6, "hexahedron": 1.0}


def one_cell(kind, comm):
    none, points = np.empty(0, np.int64), UNIT_CORNERS[kind].astype(float)
    share = Share(kind, np.arange(len(points), dtype=np.int32)[None], np.array([7]), none, points, np.arange(len(points)) + 3, none)
    return build_plex(comm, share, GhostExchange(comm, share.cell_id, none, none), GhostExchange(comm, share.vertex_id, none, none))


@pytest.mark.parametrize("kind", sorted(PLEX_CORNERS))
def test_petsc_sees_the_cell_that_is_meant(kind, comm):
    """PETSc's own volume and centroid are right when the corners stand in its order."""
    plex = one_cell(kind, comm)
    n = len(UNIT_CORNERS[kind])
    assert plex.getChart() == (0, n + 1) and plex.getHeightStratum(0) == (0, 1) and plex.getDepthStratum(0) == (1, n + 1)
    assert (plex.getCone(0) - 1).tolist() == PLEX_CORNERS[kind]
    assert plex.getCoordinatesLocal().array == pytest.approx(UNIT_CORNERS[kind].ravel())
    plex.interpolate()
    volume, centroid, _ = plex.computeCellGeometryFVM(0)
    assert volume == pytest.approx(MEASURE[kind]) and centroid == pytest.approx(UNIT_CORNERS[kind].mean(axis=0))


def test_an_error_of_petsc_is_raised(comm):
    plex = one_cell("quad", comm)
    with pytest.raises(RuntimeError, match="needs PETSc's DMPlexImaginary"):
        call_petsc("DMPlexImaginary", plex)
    call_petsc("DMPlexCheckSymmetry", plex)
    call_petsc("DMPlexCheckSkeleton", plex, ctypes.c_int(0))
