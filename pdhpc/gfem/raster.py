"""The displacement between the particles of enriched cells: rebuilt at a raster finer than their lattice, for pictures."""
from typing import NamedTuple

import numpy as np

from pdhpc.fem.elements import ELEMENTS
from pdhpc.mls.basis import Basis
from pdhpc.mls.reconstruct import MovingLeastSquares

_FINEST = 8  # points to a spacing
_MOST = 200_000  # points of all ranks
_RADIUS, _HALF_DIAGONAL = 2.0, 0.71  # of the weights, where bonds reach that far; from a particle to the corner of its square; spacings


class Raster(NamedTuple):
    """A raster of points over a rank's enriched cells.

    position (n, dim), m. displacement (n, dim), m, NaN where no particle is near. corner (n, corners) int32, local vertices of each point's cell;
    shape (n, corners), values of its functions. pixel : distance of the points, m.
    """

    position: np.ndarray
    displacement: np.ndarray
    corner: np.ndarray
    shape: np.ndarray
    pixel: float


def rebuild(comm, stepper):
    """Return the Raster of a coupled step, by moving least squares cut off at broken bonds: displacements jump across cracks. Collective."""
    local, mesh = stepper.local, stepper.solution.mesh
    lattice, cells = local.lattice, np.flatnonzero(stepper.patches.enriched[: mesh.n_owned_cells])
    number = lattice.ratio * _fineness(comm.allreduce(len(cells)) * lattice.ratio**mesh.dim, mesh.dim)
    inside = (np.stack(np.meshgrid(*[np.arange(number)] * mesh.dim, indexing="ij"), axis=-1).reshape(-1, mesh.dim) + 0.5) / number
    position = (mesh.points[mesh.cells[cells, 0]][:, None] + inside * mesh.cell_size).reshape(-1, mesh.dim)
    stepper.view.prepare()
    fit = _fit_of(local.subdomain, lattice.spacing, mesh.dim)
    found = fit.reconstruct(position, fit.nearest(position), local.subdomain.particles.position)
    displacement = np.where(found.degree[:, None] >= 0, found.value, np.nan)
    corner, shape = np.repeat(mesh.cells[cells], len(inside), axis=0), np.tile(ELEMENTS[mesh.kind].shape(inside), (len(cells), 1))
    return Raster(position, displacement, corner, shape, float(mesh.cell_size[0]) / number)


def _fineness(particles, dim):
    """Return the number of points to a spacing: what the number of particles leaves room for."""
    return int(np.clip((_MOST / max(particles, 1)) ** (1.0 / dim), 1, _FINEST))


def _fit_of(subdomain, spacing, dim):
    """Return the MovingLeastSquares of the particles; weights reach no farther than bonds do."""
    reach = float(np.linalg.norm(subdomain.bonds.arrays.vector, axis=1).max())
    return MovingLeastSquares(subdomain, spacing, reach, Basis(dim, 1, min(_RADIUS, reach / spacing - _HALF_DIAGONAL)))
