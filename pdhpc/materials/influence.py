"""Influence functions omega(r) and the moments of them that calibrate bond-based materials."""
import math

import numpy as np

CONSTANT, INVERSE_DISTANCE, GAUSSIAN = 0, 1, 2
CODES = {"constant": CONSTANT, "inverse_distance": INVERSE_DISTANCE, "gaussian": GAUSSIAN}
FORMULAS = {"constant": "omega = 1", "inverse_distance": "omega = delta/r", "gaussian": "omega = exp(-(r/delta)^2)"}


def moment(name, power, horizon):
    """Return the integral of omega(r) r^power over 0 < r < horizon, m^(power + 1).

    Constant: delta^(p+1)/(p+1); inverse distance: delta^(p+1)/p; Gaussian: delta^(p+1) times the integral of t^p exp(-t^2) over (0, 1).
    """
    scale = horizon ** (power + 1)
    if name == "constant":
        return scale / (power + 1)
    if name == "inverse_distance":
        return scale / power
    return scale * _gaussian_moment(power)


def _gaussian_moment(power):
    """Integral of t^p exp(-t^2) over (0, 1), by I_p = ((p - 1) I_(p-2) - e^-1) / 2 from I_0 = sqrt(pi)/2 erf(1) and I_1 = (1 - e^-1)/2."""
    if power == 0:
        return math.sqrt(math.pi) / 2 * math.erf(1.0)
    if power == 1:
        return (1 - math.exp(-1)) / 2
    return ((power - 1) * _gaussian_moment(power - 2) - math.exp(-1)) / 2


def value(name, r, horizon):
    """Return omega(r) of an array of distances r, m."""
    if name == "constant":
        return np.ones_like(r)
    return horizon / r if name == "inverse_distance" else np.exp(-((r / horizon) ** 2))
