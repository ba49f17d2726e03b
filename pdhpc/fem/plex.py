"""A DMPlex out of the cells that each rank has, joined by its point SF; nothing is gathered."""
import ctypes

import numpy as np

PLEX_CORNERS = {"triangle": [0, 1, 2], "quad": [0, 1, 2, 3], "tetra": [1, 0, 2, 3], "hexahedron": [0, 3, 2, 1, 4, 5, 6, 7]}
"""The corner in VTK order that stands at each place of a cone in PETSc's order."""


def build_plex(comm, share, cell_exchange, vertex_exchange):
    """Return the DMPlex of a mesh whose cells and vertices the ranks have numbered. Collective.

    Points of its chart are the local cells, then the local vertices, both as numbered in `share`; edges and faces are left out. Its coordinates, m, are
    local. Leaves of the point SF are ghost cells and ghost vertices, with their owners' points as roots. Costs about 220 bytes per hexahedron.

    Parameters
    ----------
    share : Share. cell_exchange, vertex_exchange : GhostExchange of its cells and vertices.

    Raises
    ------
    RuntimeError: the PETSc in use does not let its C functions be called.
    """
    from petsc4py import PETSc

    dim, (n_cells, n_corners) = share.points.shape[1], share.cells.shape
    plex = PETSc.DMPlex().create(comm)
    plex.setDimension(dim)
    cones = np.ascontiguousarray(share.cells[:, PLEX_CORNERS[share.kind]], dtype=PETSc.IntType)
    points = np.ascontiguousarray(share.points, dtype=PETSc.RealType)
    count = np.ctypeslib.as_ctypes_type(PETSc.IntType)
    sizes = count(n_cells), count(len(points)), count(n_corners)
    call_petsc("DMPlexBuildFromCellList", plex, *sizes, ctypes.c_void_p(cones.ctypes.data))
    call_petsc("DMPlexBuildCoordinatesFromCellList", plex, count(dim), ctypes.c_void_p(points.ctypes.data))
    call_petsc("DMPlexSetOverlap", plex, ctypes.c_void_p(), count(1 if comm.size > 1 else 0))
    plex.setPointSF(_join(comm, share, cell_exchange, vertex_exchange))
    return plex


def call_petsc(name, *arguments):
    """Call a C function of PETSc that petsc4py leaves out; objects of petsc4py are passed as what they stand for. As collective as the function.

    Raises
    ------
    RuntimeError: there is no such function, or it returned an error.
    """
    from petsc4py import PETSc

    try:
        function = getattr(ctypes.CDLL(PETSc.__file__), name)
    except (OSError, AttributeError) as missing:
        raise RuntimeError(f"a distributed mesh needs PETSc's {name}, which the library behind petsc4py {PETSc.__file__} does not show") from missing
    error = function(*[ctypes.c_void_p(argument.handle) if isinstance(argument, PETSc.Object) else argument for argument in arguments])
    if error:
        raise RuntimeError(f"PETSc's {name} failed with error {error}")


def _join(comm, share, cell_exchange, vertex_exchange):
    """Return the point SF: ghost cells and vertices as leaves, their owners' points as roots. Collective."""
    from petsc4py import PETSc

    n_cells, n_vertices = len(share.cells), len(share.points)
    point = np.arange(n_cells + n_vertices, dtype=np.int64)[:, None]
    for rows, exchange in ((slice(0, n_cells), cell_exchange), (slice(n_cells, None), vertex_exchange)):
        bound = exchange.bind(point[rows])
        bound.refresh()
        bound.free()
    ghosts = np.concatenate([np.arange(cell_exchange.n_owned, n_cells), np.arange(n_cells + vertex_exchange.n_owned, n_cells + n_vertices)])
    owners = np.concatenate([share.cell_owner, share.vertex_owner])
    roots = np.stack([owners, point[ghosts, 0]], axis=1)
    forest = PETSc.SF().create(comm)
    forest.setGraph(n_cells + n_vertices, ghosts.astype(PETSc.IntType), roots.astype(PETSc.IntType))
    return forest
