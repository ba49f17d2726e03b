"""Scalar response of a region to multipliers that ramp up over a macro step: what the interface operators are made of.

With z = omega^2 dT^2 and m velocity-Verlet steps of dT/m, from rest, a load (j/m) x at step j gives u = dT^2 U(z) x, v = dT V(z) x, a = A(z) x: polynomials of
degree m - 1 in z, and V = F_m / 2 with the Fejer kernel F_m(z) = [sin(m th/2)/(m sin(th/2))]^2, cos th = 1 - z/(2 m^2).
"""
import numpy as np
from numpy.polynomial import chebyshev

_SLACK = 1.02


def largest_z(macro_dt, critical_dt):
    """Return a bound of omega^2 dT^2 over a region: 1.02 * 4 (dT/dt_c)^2."""
    return _SLACK * 4.0 * (macro_dt / critical_dt) ** 2


def ramp_response(m, z):
    """Return (U, V, A) at z (array) by m steps of velocity Verlet."""
    dt = 1.0 / m
    u = v = a = np.zeros_like(np.asarray(z, float))
    for j in range(1, m + 1):
        u = u + dt * v + 0.5 * dt * dt * a
        new = j / m - z * u
        v = v + 0.5 * dt * (a + new)
        a = new
    return u, v, a


def fejer(m, z):
    """Return F_m(z), 1 at z = 0."""
    return 2.0 * ramp_response(m, np.asarray(z, float))[1]


def chord(m, z):
    """Return c with 1 - c z' >= F_m(z') for 0 <= z' <= z while z <= about 4: c = (1 - F_m(z))/z."""
    return float((1.0 - fejer(m, z)) / z)


def response_polynomials(m, degree, z):
    """Return the coefficients (c^u, c^v, c^a), ascending powers, of the interpolants of (U, V, A) in the Chebyshev points of [0, z], of degree min(degree, m - 1).

    They are (U, V, A) themselves where the degree reaches m - 1.
    """
    degree = min(degree, m - 1)
    found = []
    for part in range(3):
        nodes = chebyshev.chebinterpolate(lambda t: ramp_response(m, 0.5 * (t + 1.0) * z)[part], degree)
        power = np.polynomial.Polynomial(chebyshev.cheb2poly(nodes))(np.polynomial.Polynomial([-1.0, 2.0 / z]))
        coefficients = np.zeros(degree + 1)
        coefficients[: len(power.coef)] = power.coef
        found.append(coefficients)
    return tuple(found)
