"""Reference elements with linear shape functions: lines, quads, hexahedra on [0, 1]^dim; triangles and tetrahedra on the unit simplex."""
import numpy as np

from pdhpc.fem.facets import FACETS, UNIT_CORNERS


class Element:
    """One kind of cell: shape functions N_i with N_i(corner j) = delta_ij, their gradients, quadrature, facets.

    Attributes
    ----------
    kind : its name in ELEMENTS. dim : 1, 2 or 3. corners : their number. places (corners, dim) : reference coordinates of the corners.
    facets (n_facets, facet corners) : corners of each facet, outward as in facets.FACETS. facet : kind of a facet. gauss : (points (n, dim), weights (n,))
    that integrate stiffness and mass, exactly where the map from the reference is linear.
    """

    def __init__(self, kind, places, facets, facet):
        self.kind, self.places, self.facet = kind, np.array(places, float), facet
        self.facets = np.array(facets, np.int32)
        self.corners, self.dim = self.places.shape
        self.simplex = self.corners == self.dim + 1 and self.dim > 1
        self.gauss = _SIMPLEX_GAUSS[self.dim] if self.simplex else self.quadrature(2)
        for each in (self.places, self.facets, *self.gauss):
            each.flags.writeable = False

    def shape(self, xi):
        """Return N (n, corners) at reference coordinates xi (n, dim)."""
        xi = np.atleast_2d(xi)
        if self.simplex:
            return np.column_stack([1.0 - xi.sum(axis=1), xi])
        return _product(self._factors(xi), range(self.dim))

    def gradient(self, xi):
        """Return dN/dxi (n, corners, dim) at reference coordinates xi (n, dim)."""
        xi = np.atleast_2d(xi)
        if self.simplex:
            constant = np.vstack([-np.ones(self.dim), np.eye(self.dim)])
            return np.broadcast_to(constant, (len(xi), *constant.shape)).copy()
        factors, result = self._factors(xi), np.empty((len(xi), self.corners, self.dim))
        for axis in range(self.dim):
            others = [other for other in range(self.dim) if other != axis]
            result[:, :, axis] = _product(factors, others) * (2 * self.places[:, axis] - 1)
        return result

    def _factors(self, xi):
        """Return (n, corners, dim): N is their product over the axes."""
        return np.where(self.places == 1.0, xi[:, None, :], 1.0 - xi[:, None, :])

    def quadrature(self, n):
        """Return (points (n^dim, dim), weights (n^dim,)), exact for polynomials of degree 2 n - 1 by axis; of simplices for degree 2 n - dim in all."""
        x, w = np.polynomial.legendre.leggauss(n)
        grid = np.meshgrid(*[0.5 * (x + 1)] * self.dim, indexing="ij")
        points = np.stack([each.ravel() for each in grid], axis=1)
        weights = np.prod(np.stack([each.ravel() for each in np.meshgrid(*[0.5 * w] * self.dim, indexing="ij")]), axis=0)
        if not self.simplex:
            return points, weights
        left = np.ones(len(points))  # the cube collapsed onto the simplex: each coordinate is a share of what those before it left
        for axis in range(self.dim):
            points[:, axis] *= left
            if axis < self.dim - 1:
                weights = weights * (left - points[:, axis])
            left = left - points[:, axis]
        return points, weights


def _product(factors, axes):
    """Return (n, corners): the product of factors (n, corners, dim) over some axes, many times as fast as numpy's over a short one."""
    result = np.ones(factors.shape[:2])
    for axis in axes:
        result *= factors[:, :, axis]
    return result


def _tetra_gauss():
    a, b = (5 + 3 * np.sqrt(5.0)) / 20, (5 - np.sqrt(5.0)) / 20
    return np.array([[b, b, b], [a, b, b], [b, a, b], [b, b, a]]), np.full(4, 1 / 24)


_SIMPLEX_GAUSS = {2: (np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)), 3: _tetra_gauss()}  # degree 2

_FACET_KIND = {"quad": "line", "triangle": "line", "hexahedron": "quad", "tetra": "triangle"}

ELEMENTS = {
    "line": Element("line", [[0], [1]], [[0], [1]], None),
    **{kind: Element(kind, UNIT_CORNERS[kind], FACETS[kind], facet) for kind, facet in _FACET_KIND.items()},
}
