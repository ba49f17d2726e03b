"""What one rank holds of a mesh, as arrays: the same whether it was made from a box or carried here from a file."""
from typing import NamedTuple

import numpy as np


class Share(NamedTuple):
    """Owned cells and vertices first, ascending in id; then ghosts by (owner, id).

    kind : "triangle", "quad", "tetra" or "hexahedron". cells : (n_cells, corners) int32, local vertices. cell_id : (n_cells,) int64.
    cell_owner : (n_ghost_cells,) int64. points : (n_vertices, dim) float, m. vertex_id : (n_vertices,) int64. vertex_owner : (n_ghost_vertices,) int64.
    """

    kind: str
    cells: np.ndarray
    cell_id: np.ndarray
    cell_owner: np.ndarray
    points: np.ndarray
    vertex_id: np.ndarray
    vertex_owner: np.ndarray


def order_owned_first(owner, ids, rank):
    """Return (order, n_owned): what puts the rank's own first, ascending in id, then the others by (owner, id). Local."""
    ghost = owner != rank
    return np.lexsort((ids, np.where(ghost, owner, -1))), len(owner) - int(np.count_nonzero(ghost))
