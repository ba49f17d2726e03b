"""Bases of a cell: which functions it carries at each corner, and where to integrate their products."""
from pdhpc.fem.elements import ELEMENTS


class Hats:
    """The element's own shape functions, one at each corner: P_i = span{1}.

    functions : per corner. element : Element. quadrature : (points, weights) for stiffness and mass.
    """

    functions = 1

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

    def facet_quadrature(self):
        """Return (points (n, dim - 1), weights) on a facet. Local."""
        return ELEMENTS[self.element.facet].gauss

    def fine_quadrature(self):
        """Return (points, weights) for what is no polynomial, such as a difference to a known solution. Local."""
        return self.element.quadrature(4)
