"""Influence functions omega(r) and the moments of them that calibrate bond-based materials."""
import math

import numpy as np

CONSTANT, INVERSE_DISTANCE, GAUSSIAN, CONICAL = 0, 1, 2, 3
CODES = {"constant": CONSTANT, "inverse_distance": INVERSE_DISTANCE, "gaussian": GAUSSIAN, "conical": CONICAL}
FORMULAS = {
    "constant": "omega = 1", "inverse_distance": "omega = delta/r", "gaussian": "omega = exp(-(r/delta)^2)", "conical": "omega = max(0, 1 - r/delta)",
}


def moment(name, power, horizon):
    """Return the integral of omega(r) r^power over 0 < r < horizon, m^(power + 1).

    Constant: delta^(p+1)/(p+1); inverse distance: delta^(p+1)/p; conical: delta^(p+1)/((p+1)(p+2)); Gaussian: delta^(p+1) times the integral of
    t^p exp(-t^2) over (0, 1).
    """
    scale = horizon ** (power + 1)
    if name == "constant":
        return scale / (power + 1)
    if name == "inverse_distance":
        return scale / power
    if name == "conical":
        return scale / ((power + 1) * (power + 2))
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
    if name == "conical":
        return np.maximum(0.0, 1.0 - r / horizon)
    return horizon / r if name == "inverse_distance" else np.exp(-((r / horizon) ** 2))


def largest_first_moment(name, horizon, reach):
    """Return the largest omega(r) r, m, of bonds of length 0 < r <= reach, m.

    Constant: reach; inverse distance: delta; conical: delta/4, at r = delta/2; Gaussian: delta exp(-1/2)/sqrt(2), at r = delta/sqrt(2).
    """
    if name == "constant":
        return reach
    return horizon * {"inverse_distance": 1.0, "conical": 0.25, "gaussian": math.exp(-0.5) / math.sqrt(2)}[name]
