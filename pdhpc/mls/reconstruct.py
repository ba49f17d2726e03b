"""Fields and gradients at any points from particles, cut off at broken bonds: modified moving least squares with the Voronoi cut-off.

    eta(x) = q_x(0),  q_x = argmin over p in P of sum_i W_i(x) |u_i - p(x_i - x)|^2,  grad eta(x) = the linear coefficients of q_x
    W_i(x) = W0(|x - x_i| / (R h)) A_{i j*},  W0(r) = (1 - r^2)^2

j* is the particle nearest to x, A_{i j*} = 1 where the bond i j* is intact or i = j*, else 0: a point sees what the particle in whose Voronoi cell it lies
sees. So the particles with weight are j* and its intact family, and eta jumps where families do. Where these are too few or too flat for the degree of P it
is lowered, at last to 0: a mean.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import inlined, sweep
from pdhpc.kernels import cloud, lattice  # noqa: F401  (they fill the functions of family.py in)
from pdhpc.kernels.family import end_of_bonds, first_bond, is_alive, neighbour, place, reference_vector
from pdhpc.mls.basis import factorise, polynomials, size_of, solve
from pdhpc.mls.nearest import cells_of_cloud, cells_of_lattice, nearest


class Reconstruction(NamedTuple):
    """What a field is at n points.

    value (n, width); gradient (n, width, dim), per metre; degree (n,) int8, of the polynomials used: -1, with value and gradient 0, where there was nothing
    to use or the point is another rank's, so that sums over ranks hold every point once.
    """

    value: np.ndarray
    gradient: np.ndarray
    degree: np.ndarray


def empty_reconstruction(n, width, dim):
    """Return a Reconstruction to be filled. Local."""
    return Reconstruction(np.empty((n, width)), np.empty((n, width, dim)), np.empty(n, np.int8))


class MovingLeastSquares:
    """Modified moving least squares on the particles of one rank.

    A point belongs to the rank that owns the particle nearest to it. Families and positions have the same order and bits on any rank, so results do too.

    Attributes
    ----------
    basis : Basis. spacing, reach : m.
    """

    def __init__(self, subdomain, spacing, reach, basis):
        """subdomain : what has `bonds.arrays`, `points` and `particles` (slots, id) of a rank. spacing : m. reach : m, up to which particles have bonds.

        Bond states are read at each reconstruction, as they are then.

        Raises
        ------
        ValueError: bonds reach less far than the weights do (Basis.check_reach).
        """
        basis.check_reach(spacing, reach)
        self.basis, self.spacing, self.reach = basis, float(spacing), float(reach)
        self._bonds, self._particles = subdomain.bonds.arrays, subdomain.points
        self._owned = np.zeros(len(self._particles.position), bool)
        self._owned[subdomain.particles.slots] = True
        if hasattr(self._bonds, "offset"):
            self._cells = cells_of_lattice(self._bonds, self._particles, spacing)
        else:
            self._cells = cells_of_cloud(self._particles, subdomain.particles.id, spacing)

    def nearest(self, points):
        """Return (n,) int32: the slot of the owned particle nearest to each point (n, dim), m. Local.

        -1 marks points that belong to another rank, and those farther than half the reach of bonds from any particle. Of particles equally near the first
        id counts.
        """
        return nearest(self._cells, self._owned, points, 0.5 * self.reach)

    def reconstruct(self, points, near, values, valid=None, result=None):
        """Return the Reconstruction of a field at points. Local.

        Parameters
        ----------
        points : (n, dim), m, in the unloaded body. near : (n,) int32, what `nearest` says of them.
        values : (n_slots, width), the field by slot, ghosts fresh. valid : None, or (n_slots,) bool, which particles' values may be used, ghosts too.
        result : None, or a Reconstruction of n points to overwrite.
        """
        points, dim, size = np.asarray(points, float), self.basis.dim, self.basis.size
        result = empty_reconstruction(len(points), values.shape[1], dim) if result is None else result
        fit = _Fit(self.basis.degree, 1.0 / self.spacing, 1.0 / self.basis.radius**2)
        work = _Work(np.empty((size, size)), np.empty((size, values.shape[1])), np.empty(size))
        _fit_all(self._bonds, self._particles, None if dim == 2 else 2, fit, points, near, values, valid, work, result)
        return result


class _Fit(NamedTuple):
    """Degree; 1 / spacing, 1/m; 1 / radius^2, in spacings."""

    degree: int
    per_length: float
    inverse_radius2: float


class _Work(NamedTuple):
    """Normal equations a (size, size) and b (size, width) of one point, polynomials p (size,) of one particle."""

    a: np.ndarray
    b: np.ndarray
    p: np.ndarray


@sweep
def _fit_all(bonds, particles, third, fit, points, near, values, valid, work, result):
    """Store the fits at all points, as MovingLeastSquares.reconstruct says, in result."""
    for n in range(len(points)):
        used = -1
        if near[n] >= 0:
            seen = _gather(bonds, particles, third, fit, points, n, near[n], values, valid, work)
            if seen > 0:
                used = _bearable(seen, work.a, points.shape[1], fit.degree)
        result.degree[n] = used
        _store(fit, work, used, n, result)


@inlined
def _gather(bonds, particles, third, fit, points, n, j, values, valid, work):
    """Set up the normal equations of point n from particle j, the nearest, and its intact family in the order of their ids; return how many have weight."""
    work.a[:] = 0.0
    work.b[:] = 0.0
    x, y, z = place(bonds, particles, j)
    x, y, z = x - points[n, 0], y - points[n, 1], 0.0 if third is None else z - points[n, 2]
    seen = _add(third, fit, x, y, z, j, values, valid, work)
    for k in range(first_bond(bonds, j), end_of_bonds(bonds, j)):
        if is_alive(bonds, j, k):
            i = neighbour(bonds, j, k)
            dx, dy, dz = reference_vector(bonds, particles, j, i, k, third)
            seen += _add(third, fit, x + dx, y + dy, z + dz, i, values, valid, work)
    return seen


@inlined
def _add(third, fit, x, y, z, i, values, valid, work):
    """Add particle i, (x, y, z), m, from the point, to the normal equations; return 1, or 0 if it has no weight."""
    x, y, z = x * fit.per_length, y * fit.per_length, z * fit.per_length
    r2 = (x * x + y * y + z * z) * fit.inverse_radius2
    if not r2 < 1.0:
        return 0
    if valid is not None:
        if not valid[i]:
            return 0
    weight = (1.0 - r2) ** 2
    polynomials(x, y, z, third, fit.degree, work.p)
    for s in range(len(work.p)):
        part = weight * work.p[s]
        for t in range(s + 1):
            work.a[s, t] += part * work.p[t]
        for c in range(values.shape[1]):
            work.b[s, c] += part * values[i, c]
    return 1


@inlined
def _bearable(seen, a, dim, degree):
    """Factorise the normal equations and return the largest degree that the particles seen bear."""
    pivots = factorise(a)
    while degree > 0 and size_of(dim, degree) > min(seen, pivots):
        degree -= 1
    return degree


@inlined
def _store(fit, work, used, n, result):
    """Store value and gradient at point n of a fit of degree `used`; zeros where that is -1."""
    dim = result.gradient.shape[2]
    if used >= 0:
        solve(work.a, size_of(dim, used), work.b)
    for c in range(result.value.shape[1]):
        result.value[n, c] = work.b[0, c] if used >= 0 else 0.0
        for d in range(dim):
            result.gradient[n, c, d] = work.b[1 + d, c] * fit.per_length if used > 0 else 0.0
