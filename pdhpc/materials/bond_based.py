"""Bond-based prototype microelastic brittle material (PMB; Silling 2000, Silling & Askari 2005)."""
import math
from dataclasses import dataclass
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.jit import inlined
from pdhpc.materials.influence import CODES, CONSTANT, INVERSE_DISTANCE, moment

POISSONS_RATIO = {"plane_stress": 1 / 3, "plane_strain": 1 / 4, "3d": 1 / 4}
"""Poisson's ratio that central forces of equal micromodulus in all directions impose."""

CRITICAL_STRETCH_FORMULA = {
    "plane_stress": "s0 = sqrt(G / (t c I3)), I3 = int omega r^3 dr; constant omega: sqrt(4 pi G / (9 E delta)) (Ha & Bobaru 2010)",
    "plane_strain": "s0 = sqrt(G / (t c I3)), I3 = int omega r^3 dr; constant omega: sqrt(5 pi G / (12 E delta)) (Ha & Bobaru 2010)",
    "3d": "s0 = sqrt(2 G / (pi c I4)), I4 = int omega r^4 dr; constant omega: sqrt(10 G / (pi c delta^5)) = sqrt(5 G / (6 E delta)) (Silling & Askari 2005)",
}


@dataclass(frozen=True)
class BondBased:
    """Parameters of a PMB material: pair force density t = c omega(r) beta(r) s along the deformed bond, s = (|y'| - r)/r, until s exceeds s0.

    youngs_modulus, Pa; density, kg/m^3; energy_release_rate, J/m^2, or critical_stretch: at most one of them; neither means that bonds never break.
    Exchanged fields: positions (refresh), nothing else.
    """

    name: str
    density: float
    youngs_modulus: float
    energy_release_rate: Optional[float] = None
    critical_stretch: Optional[float] = None

    def micromodulus(self, setting):
        """Return c, N/m^6, such that an isotropic stretch stores the energy of linear elasticity.

        3D: c = 9 K / (2 pi I3), K = 2E/3; plane stress: c = 3 E / (pi t I2); plane strain: c = 16 E / (5 pi t I2), with I_p = int_0^delta omega r^p dr.
        Constant omega gives 18 K/(pi delta^4), 9 E/(pi t delta^3), 48 E/(5 pi t delta^3) (Silling & Askari 2005; Gerstle et al. 2005; Ha & Bobaru 2010).
        """
        modulus, horizon = self.youngs_modulus, setting.horizon
        if setting.dimension == "3d":
            return 9 * (2 * modulus / 3) / (2 * math.pi * moment(setting.influence, 3, horizon))
        factor = 3 if setting.dimension == "plane_stress" else 16 / 5
        return factor * modulus / (math.pi * setting.thickness * moment(setting.influence, 2, horizon))

    def stretch_limit(self, setting):
        """Return s0: given, or from the energy release rate G (see CRITICAL_STRETCH_FORMULA), or infinite."""
        if self.critical_stretch is not None:
            return self.critical_stretch
        if self.energy_release_rate is None:
            return math.inf
        c = self.micromodulus(setting)
        if setting.dimension == "3d":
            return math.sqrt(2 * self.energy_release_rate / (math.pi * c * moment(setting.influence, 4, setting.horizon)))
        return math.sqrt(self.energy_release_rate / (setting.thickness * c * moment(setting.influence, 3, setting.horizon)))


class Setting(NamedTuple):
    """What calibration needs beside the material: dimension ("plane_stress", "plane_strain", "3d"), horizon (m), thickness (m), influence by name."""

    dimension: str
    horizon: float
    thickness: float
    influence: str


class Law(NamedTuple):
    """A bond-based law as kernels see it; tables are indexed by the blocks of a bond's two ends.

    micromodulus (n_block, n_block), N/m^6; critical_stretch (n_block, n_block); density (n_block,), kg/m^3; horizon, m; ramp_end, m, and ramp_slope, 1/m:
    the volume correction is beta = min(1, (ramp_end - r) ramp_slope).
    """

    micromodulus: np.ndarray
    critical_stretch: np.ndarray
    density: np.ndarray
    horizon: float
    ramp_end: float
    ramp_slope: float
    influence: int


def family_radius(horizon, spacing, volume_correction):
    """Return the distance up to which particles are bonded, m: delta, or delta + h/2 (excluded) with the linear volume correction.

    The relative slack of 1e-9 keeps lattice neighbours at exactly the limit in or out whatever round-off says.
    """
    return (horizon + spacing / 2) * (1 - 1e-9) if volume_correction == "linear" else horizon * (1 + 1e-9)


def make_law(blocks, setting, spacing, volume_correction):
    """Return the Law of a list of blocks [(BondBased, may_fail)].

    A bond between two materials is two half-bonds in series: c = 2 c_i c_j / (c_i + c_j), s0 the smaller of the two; a bond with an end in a block that may
    not fail never breaks. The linear volume correction counts the share of a
    neighbour's cell that lies within the horizon: beta falls from 1 at r = delta - h/2 to 0 at delta + h/2 (Seleson & Littlewood 2016).
    """
    c = np.array([material.micromodulus(setting) for material, _ in blocks])
    limit = np.array([material.stretch_limit(setting) for material, _ in blocks])
    may_fail = np.array([fails for _, fails in blocks])
    pair_limit = np.where(may_fail[:, None] & may_fail[None, :], np.minimum(limit[:, None], limit[None, :]), np.inf)
    pair_c = np.where(c[:, None] == c[None, :], c[:, None], 2 * c[:, None] * c[None, :] / (c[:, None] + c[None, :]))
    density = np.array([material.density for material, _ in blocks])
    corrected = volume_correction == "linear"
    ramp_end, slope = (setting.horizon + spacing / 2, 1 / spacing) if corrected else (4 * setting.horizon, 1 / setting.horizon)
    return Law(pair_c, pair_limit, density, float(setting.horizon), float(ramp_end), float(slope), CODES[setting.influence])


# The law, written once for floats and for vectors of eight bonds (kernels/simd.py).


@inlined
def bond_weight(inv_length, law):
    """Return omega(r) beta(r) / r, 1/m, of a bond of length r = 1/inv_length: omega = 1, delta/r or exp(-(r/delta)^2)."""
    corrected = min(inv_length, (inv_length * law.ramp_end - 1.0) * law.ramp_slope)
    if law.influence == CONSTANT:
        return corrected
    if law.influence == INVERSE_DISTANCE:
        return corrected * (law.horizon * inv_length)
    ratio = 1.0 / (law.horizon * inv_length)
    return corrected * math.exp(0.0 - ratio * ratio)


@inlined
def pair_force(micromodulus, weight, stretch):
    """Return the pair force density per bond length, c omega beta s / r, N/m^7."""
    return micromodulus * weight * stretch


@inlined
def pair_energy(micromodulus, weight, stretch, inv_length):
    """Return the micropotential c omega beta s^2 r / 2, J/m^6."""
    return 0.5 * micromodulus * weight * stretch * stretch / (inv_length * inv_length)
