"""Velocities about an axis: outwards, along it and around it, each a polynomial in the place along the axis."""
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class AxialMotion:
    """v = v_r e_r + v_z a + w a x rho, where x - origin = z a + rho and e_r = rho/|rho| (0 on the axis).

    Each of v_r, v_z, m/s, and w, rad/s, is a polynomial sum_k c_k (z/length)^k, given as its coefficients c_0, c_1, ...; none given is 0.
    origin, axis : of 2 or 3 components; axis of any length, not used in 2D, where it points out of the plane and z = 0. length : m.
    """

    origin: tuple
    axis: tuple
    length: float
    radial: tuple = ()
    axial: tuple = ()
    angular: tuple = ()

    def velocity(self, points):
        """Return (n, dim) m/s at points (n, dim), m; of each point alone, so that it has the same bits on any number of ranks. Local."""
        axis, z, rho, outward, _ = self._frame(points)
        radial, axial, angular = (polynomial(each, z)[:, None] for each in (self.radial, self.axial, self.angular))
        return (radial * outward + axial * axis + angular * np.cross(axis, rho))[:, : points.shape[1]]

    def gradient(self, points):
        """Return (n, dim, dim) dv_a/dx_b, 1/s, at points (n, dim), m; 0 of what has none on the axis. Local."""
        axis, z, rho, outward, inverse = self._frame(points)
        radial, axial, angular = (polynomial(each, z)[:, None, None] for each in (self.radial, self.axial, self.angular))
        slopes = [polynomial(derivative(each), z)[:, None] / self.length for each in (self.radial, self.axial, self.angular)]
        across = np.eye(3) - np.outer(axis, axis) - outward[:, :, None] * outward[:, None, :]
        turn = np.cross(axis, np.eye(3)).T  # a x rho = turn rho
        along = slopes[0] * outward + slopes[1] * axis + slopes[2] * np.cross(axis, rho)
        dim = points.shape[1]
        return (radial * inverse[:, None, None] * across + angular * turn + along[:, :, None] * axis)[:, :dim, :dim]

    def _frame(self, points):
        """Return (a, z/length, rho, e_r, 1/|rho|) of points (n, dim), vectors of 3 components; 1/|rho| = 0 on the axis."""
        dim = points.shape[1]
        offset = np.zeros((len(points), 3))
        offset[:, :dim] = points - np.asarray(self.origin)
        axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else np.asarray(self.axis) / np.linalg.norm(self.axis)
        z = offset[:, 0] * axis[0] + offset[:, 1] * axis[1] + offset[:, 2] * axis[2]
        rho = offset - z[:, None] * axis
        distance = np.sqrt(rho[:, 0] ** 2 + rho[:, 1] ** 2 + rho[:, 2] ** 2)
        on_axis = distance <= 1e-12 * self.length
        inverse = np.where(on_axis, 0.0, 1.0 / np.where(on_axis, 1.0, distance))
        return axis, z / self.length, rho, rho * inverse[:, None], inverse


def polynomial(coefficients, x):
    """Return sum_k c_k x^k of each x, by Horner's rule."""
    total = np.zeros_like(x)
    for each in reversed(coefficients):
        total = total * x + each
    return total


def derivative(coefficients):
    """Return the coefficients of the derivative of a polynomial."""
    return tuple(k * each for k, each in enumerate(coefficients))[1:]
