"""A partition of unity with flat tops on boxes of cells, times linear polynomials (Griebel and Schweitzer 2000).

phi_i is 1 around vertex i, 0 around the others and linear in between, by axis; it is the product over the axes. Since a part of each phi_i is its own alone,
phi_i {1, x - x_i, y - y_i (, z - z_i)} are independent, which hats times linear polynomials are not.
"""
import numpy as np

from pdhpc.fem.elements import ELEMENTS


class FlatTop:
    """Basis of a cell of a box: at corner i phi_i times 1 and times (x_k - x_ik) / h_k of each axis k, h the size of a cell.

    functions : 1 + dim per corner. element : Element. flat : the share of a cell's side along which phi_i is 1 (and 0 at the other end). quadrature : on pieces
    between the kinks of phi, exact for stiffness and mass. kinks : along an axis of the reference.
    """

    def __init__(self, kind, flat=0.25):
        """kind : "quad" or "hexahedron", of a mesh of a box.

        Raises
        ------
        ValueError: another kind; flat is not between 0 and 1/2 (at 0 the functions would be dependent).
        """
        if kind not in ("quad", "hexahedron"):
            raise ValueError(f"cells of kind {kind}: a flat-top partition of unity is made of products over the axes, for boxes of quads or hexahedra")
        if not 0.0 < flat < 0.5:
            raise ValueError(f"flat = {flat}: the flat part of a cell's side must be above 0 and below 1/2")
        self.element, self.flat = ELEMENTS[kind], flat
        self.functions, self.kinks = 1 + self.element.dim, (0.0, flat, 1.0 - flat, 1.0)
        self.quadrature = self._pieces(self.element.dim, 3)

    def _pieces(self, dim, n):
        """Return (points, weights) on [0, 1]^dim of n Gauss points on each piece between kinks."""
        x, w = np.polynomial.legendre.leggauss(n)
        kinks = np.array(self.kinks)
        sides = np.diff(kinks)
        points = (kinks[:-1, None] + sides[:, None] * 0.5 * (x + 1)).ravel()
        weights = (sides[:, None] * 0.5 * w).ravel()
        grid = np.meshgrid(*[points] * dim, indexing="ij")
        product = np.prod(np.stack([each.ravel() for each in np.meshgrid(*[weights] * dim, indexing="ij")]), axis=0)
        return np.stack([each.ravel() for each in grid], axis=1), product

    def facet_quadrature(self):
        """Return (points (n, dim - 1), weights) on a facet. Local."""
        return self._pieces(self.element.dim - 1, 3)

    def fine_quadrature(self):
        """Return (points, weights) for what is no polynomial, such as a difference to a known solution. Local."""
        return self._pieces(self.element.dim, 4)

    def _factors(self, xi):
        """Return (values, slopes) (n, corners, dim) of phi by axis."""
        distance = np.abs(xi[:, None, :] - self.element.places)
        slope = 1.0 / (1.0 - 2.0 * self.flat)
        value = np.clip((1.0 - self.flat - distance) * slope, 0.0, 1.0)
        toward = np.where(self.element.places == 1.0, slope, -slope)
        return value, np.where((distance > self.flat) & (distance < 1.0 - self.flat), toward, 0.0)

    def shape(self, xi):
        """Return the functions (n, corners * functions), those of a corner together, at reference coordinates xi (n, dim)."""
        xi = np.atleast_2d(xi)
        phi = np.prod(self._factors(xi)[0], axis=2)
        return (phi[:, :, None] * self._polynomials(xi)).reshape(len(xi), -1)

    def gradient(self, xi):
        """Return their gradients (n, corners * functions, dim) by reference coordinates; at kinks of one side."""
        xi = np.atleast_2d(xi)
        (values, slopes), dim = self._factors(xi), self.element.dim
        polynomials, phi = self._polynomials(xi), np.prod(values, axis=2)
        result = np.zeros((len(xi), self.element.corners, self.functions, dim))
        for axis in range(dim):
            others = [other for other in range(dim) if other != axis]
            dphi = slopes[:, :, axis] * np.prod(values[:, :, others], axis=2)
            result[..., axis] = dphi[:, :, None] * polynomials
            result[:, :, 1 + axis, axis] += phi
        return result.reshape(len(xi), -1, dim)

    def _polynomials(self, xi):
        """Return (n, corners, functions): 1 and xi - xi_i."""
        local = xi[:, None, :] - self.element.places
        return np.concatenate([np.ones((*local.shape[:2], 1)), local], axis=2)

    def linear(self, mesh, gradient, shift):
        """Return the unknowns (n_vertices, width), m, of u = G x + s; gradient (dim, dim), shift (dim,), m. Local."""
        gradient = np.asarray(gradient, float)
        slopes = gradient.T * np.asarray(mesh.cell_size)[:, None]  # (axis, component)
        return np.concatenate([mesh.points @ gradient.T + shift, np.tile(slopes.ravel(), (len(mesh.points), 1))], axis=1)

    def held_functions(self, across):
        """Return (n, functions) bool: which functions a displacement prescribed on facets holds; across (n, dim) bool: normal to which axes these are.

        On a facet across axis k u depends on the constants and on the slopes along the facet alone.
        """
        along = np.stack([np.delete(across, axis, axis=1).any(axis=1) for axis in range(across.shape[1])], axis=1)
        return np.concatenate([across.any(axis=1)[:, None], along], axis=1)

    def interpolated(self, mesh, values, gradients):
        """Return unknowns (n, functions, dim), m, that have values (n, dim), m, and gradients (n, dim, dim), du_a/dx_b, at vertices. Local."""
        slopes = gradients.transpose(0, 2, 1) * np.asarray(mesh.cell_size)[:, None]
        return np.concatenate([values[:, None, :], slopes], axis=1)
