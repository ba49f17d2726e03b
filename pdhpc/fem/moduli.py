"""Elastic moduli as matrices of Voigt's notation: (xx, yy, xy) in 2D and (xx, yy, zz, yz, xz, xy) in 3D, shear strains doubled."""
import numpy as np

PAIRS = {2: ((0, 0), (1, 1), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))}
"""Tensor indices of each Voigt component, by dim."""

PLANES = ("plane_stress", "plane_strain", "3d")


def isotropic(youngs_modulus, poissons_ratio, dimension):
    """Return C (3, 3) or (6, 6), Pa: sigma = C epsilon of Hooke's law in "plane_stress", "plane_strain" or "3d".

    Raises
    ------
    ValueError: E is not above 0, or nu is outside (-1, 1/2) (plane stress: (-1, 1]), where the material has no positive energy.
    """
    e, nu = float(youngs_modulus), float(poissons_ratio)
    if dimension not in PLANES:
        raise ValueError(f"dimension {dimension!r}: must be one of {', '.join(PLANES)}")
    if not e > 0.0 or not -1.0 < nu < (1.0 if dimension == "plane_stress" else 0.5):
        raise ValueError(f"E = {e} Pa, nu = {nu} in {dimension}: E must be above 0 and nu between -1 and {1 if dimension == 'plane_stress' else 0.5}")
    dim = 3 if dimension == "3d" else 2
    shear = e / (2 * (1 + nu))
    lame = e * nu / (1 - nu * nu) if dimension == "plane_stress" else e * nu / ((1 + nu) * (1 - 2 * nu))
    c = np.diag([2 * shear] * dim + [shear] * (len(PAIRS[dim]) - dim))
    c[:dim, :dim] += lame
    return c


def checked(moduli, dim):
    """Return moduli as (n_kind, v, v), v = 3 or 6, symmetric and positive definite.

    Raises
    ------
    ValueError: another shape, not symmetric to 1e-10 of the largest entry, or not positive definite.
    """
    c, size = np.array(moduli, float), len(PAIRS[dim])
    c = c[None] if c.ndim == 2 else c
    if c.ndim != 3 or c.shape[1:] != (size, size):
        raise ValueError(f"moduli of shape {c.shape}: in {dim}D each kind has a {size} x {size} matrix")
    for kind, each in enumerate(c):
        if not np.abs(each - each.T).max() <= 1e-10 * np.abs(each).max():
            raise ValueError(f"moduli of kind {kind} are not symmetric: {each.tolist()}")
        lowest = np.linalg.eigvalsh(0.5 * (each + each.T))[0]
        if not lowest > 0.0:
            raise ValueError(f"moduli of kind {kind} are not positive definite: the lowest eigenvalue is {lowest:.3g} Pa")
    return 0.5 * (c + c.transpose(0, 2, 1))
