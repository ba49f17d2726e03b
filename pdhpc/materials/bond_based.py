"""Bond-based prototype microelastic brittle material (PMB; Silling 2000, Silling & Askari 2005)."""
import math
from dataclasses import dataclass
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.jit import implements
from pdhpc.materials import law as laws
from pdhpc.materials.failure import EnergyLimit, critical_pair_energy, stretch_failure
from pdhpc.materials.influence import largest_first_moment, moment
from pdhpc.materials.law import Weighting, influence_over_length, make_weightings, of_pairs, reach_of, settings_of, smaller_where_both_fail, stretch_limits

POISSONS_RATIO = {"plane_stress": 1 / 3, "plane_strain": 1 / 4, "3d": 1 / 4}
"""Poisson's ratio that central forces of equal micromodulus in all directions impose."""

CRITICAL_STRETCH_FORMULA = {
    "plane_stress": "s0 = sqrt(G / (t c I3)), I3 = int omega r^3 dr; constant omega: sqrt(4 pi G / (9 E delta)) (Ha & Bobaru 2010)",
    "plane_strain": "s0 = sqrt(G / (t c I3)), I3 = int omega r^3 dr; constant omega: sqrt(5 pi G / (12 E delta)) (Ha & Bobaru 2010)",
    "3d": "s0 = sqrt(2 G / (pi c I4)), I4 = int omega r^4 dr; constant omega: sqrt(10 G / (pi c delta^5)) = sqrt(5 G / (6 E delta)) (Silling & Askari 2005)",
}


class BondBasedLaw(NamedTuple):
    """The bond-based law as kernels see it; tables are indexed by the blocks of a bond's two ends.

    micromodulus (n_block, n_block), N/m^6; critical_stretch, break_at (n_block, n_block), see materials/law.py; density (n_block,), kg/m^3.
    """

    micromodulus: np.ndarray
    critical_stretch: np.ndarray
    break_at: np.ndarray
    density: np.ndarray
    weighting: Weighting  # or PairWeighting
    failure: object  # of materials/failure.py


@dataclass(frozen=True)
class BondBased:
    """Parameters of a PMB material: pair force density t = c omega(r) beta(r) s along the deformed bond, s = (|y'| - r)/r, until s exceeds s0.

    failure : "stretch" or, in the place of s0, "energy"; stretch_softening : alpha; weibull_modulus, weibull_seed, weibull_length (m) : of the scatter of s0; see
    materials/failure.py.
    youngs_modulus, Pa; density, kg/m^3; energy_release_rate, J/m^2, or critical_stretch: at most one of them; neither means that bonds never break.
    Exchanged fields: positions (refresh), nothing else.
    """

    name: str
    density: float
    youngs_modulus: float
    energy_release_rate: Optional[float] = None
    critical_stretch: Optional[float] = None
    failure: str = "stretch"
    stretch_softening: float = 0.0
    weibull_modulus: Optional[float] = None
    weibull_seed: int = 1
    weibull_length: float = 0.0

    formula = CRITICAL_STRETCH_FORMULA

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

    def wave_speed(self, setting):
        """Return the speed of longitudinal waves, m/s: sqrt(9 E/(8 rho)) in plane stress (nu = 1/3), sqrt(6 E/(5 rho)) in plane strain and 3D (nu = 1/4)."""
        return math.sqrt((9 / 8 if setting.dimension == "plane_stress" else 6 / 5) * self.youngs_modulus / self.density)

    @staticmethod
    def law(blocks, setting):
        """Return the BondBasedLaw of a list of blocks [(BondBased, may_fail)]; setting: a Setting, or a list of one for each block where horizons differ.

        A bond between two materials is two half-bonds in series: c = 2 c_i c_j / (c_i + c_j), both at the horizon of the bond, the mean of its ends'.
        """
        own = of_pairs(blocks, setting, lambda material, between: material.micromodulus(between))
        pairs = np.where(own == own.T, own, 2 * own * own.T / (own + own.T))
        density = np.array([material.density for material, _ in blocks])
        limits = energy_limits(blocks, setting) if blocks[0][0].failure == "energy" else (*stretch_limits(blocks, setting), stretch_failure(blocks, setting))
        return BondBasedLaw(pairs, *limits[:2], density, make_weightings(settings_of(blocks, setting)), limits[2])


def energy_limits(blocks, setting):
    """Return (critical_stretch, break_at, EnergyLimit) of blocks: the first two are those of the bond that breaks first, a little less, below which none does."""
    square = smaller_where_both_fail(blocks, of_pairs(
        blocks, setting, lambda material, between: 2 * critical_pair_energy(between, material.energy_release_rate) / material.micromodulus(between)))
    largest = of_pairs(blocks, setting, lambda material, between: largest_first_moment(between.influence, between.horizon, reach_of(between)))
    first = np.sqrt(square / largest) * (1 - 1e-9)
    return first, first if settings_of(blocks, setting)[0].linear else (1.0 + first) ** 2, EnergyLimit(square)


@implements(laws.bond_weight, BondBasedLaw)
def _bond_weight(law, weighting, inv_length):
    """omega beta / r, 1/m."""
    return influence_over_length(weighting, inv_length)


@implements(laws.moment_weight, BondBasedLaw)
def _moment_weight(law, weighting, inv_length):
    """omega beta r."""
    return influence_over_length(weighting, inv_length) / (inv_length * inv_length)


@implements(laws.modulus, BondBasedLaw)
def _modulus(law, block):
    """The micromodulus."""
    return law.micromodulus[block, block]


@implements(laws.near_end, BondBasedLaw)
def _near_end(law, points, state, i, j):
    """The micromodulus c of the bond."""
    return law.micromodulus[points.block[i], points.block[j]]


@implements(laws.far_end, BondBasedLaw)
def _far_end(law, state, j):
    """Nothing."""
    return 0.0


@implements(laws.moduli, BondBasedLaw)
def _moduli(law, near, far):
    """c and 0: the pull is c omega beta s / r, along the deformed bond times |xi|/|y|."""
    return near, 0.0


@implements(laws.stiffness, BondBasedLaw)
def _stiffness(law, block, c):
    """C itself."""
    return c


@implements(laws.bond_energy, BondBasedLaw)
def _bond_energy(law, near, moment, s):
    """Half of the micropotential c omega beta s^2 r / 2."""
    return 0.25 * near * (moment * s * s)


@implements(laws.volume_energy, BondBasedLaw)
def _volume_energy(law, near, spherical, total):
    """None."""
    return 0.0 * total


@implements(laws.spherical_part, BondBasedLaw)
def _spherical_part(law, block):
    """Nothing."""
    return 0.0
