"""Bases of a cell: which functions it carries at each corner, and where to integrate their products."""
import numpy as np

from pdhpc.fem.elements import ELEMENTS


class Hats:
    """The element's own shape functions, one at each corner: P_i = span{1}.

    functions : per corner. element : Element. quadrature : (points, weights) for stiffness and mass. kinks : along an axis of the reference, see fem.cuts.
    """

    functions, kinks = 1, (0.0, 1.0)

    def __init__(self, kind):
        """kind : of the cells, a name in ELEMENTS."""
        self.element = ELEMENTS[kind]
        self.quadrature = self.element.gauss

    def shape(self, xi):
        """Return the functions (n, corners) at reference coordinates xi (n, dim)."""
        return self.element.shape(xi)

    def gradient(self, xi):
        """Return their gradients (n, corners, dim) by reference coordinates."""
        return self.element.gradient(xi)

    def linear(self, mesh, gradient, shift):
        """Return the unknowns (n_vertices, dim), m, of u = G x + s; gradient (dim, dim), shift (dim,), m. Local."""
        return mesh.points @ np.asarray(gradient, float).T + shift

    def facet_quadrature(self):
        """Return (points (n, dim - 1), weights) on a facet. Local."""
        return ELEMENTS[self.element.facet].gauss

    def fine_quadrature(self):
        """Return (points, weights) for what is no polynomial, such as a difference to a known solution. Local."""
        return self.element.quadrature(4)

    def held_functions(self, across):
        """Return (n, 1) bool: whether a prescribed displacement holds the functions of vertices on facets; across (n, dim) bool: normal to which axes."""
        return across.any(axis=1)[:, None]

    def interpolated(self, mesh, values, gradients):
        """Return unknowns (n, 1, dim), m, that have values (n, dim), m, at vertices. Local."""
        return values[:, None, :]


def rigid_motions(basis, mesh):
    """Return the unknowns (n_vertices, width, 3 or 6) of the rigid motions: along the axes, and around them. Local."""
    dim, axes = mesh.dim, np.eye(mesh.dim)
    motions = [basis.linear(mesh, np.zeros((dim, dim)), axis) for axis in axes]
    motions += [basis.linear(mesh, turn, np.zeros(dim)) for turn in turns(dim)]
    return np.stack(motions, axis=-1)


def turns(dim):
    """Return (1 or 3, dim, dim): W of the rigid motions u = W x around the origin. Local."""
    axes = np.eye(dim)
    return np.array([np.outer(axes[a], axes[b]) - np.outer(axes[b], axes[a]) for a in range(dim) for b in range(a)])
