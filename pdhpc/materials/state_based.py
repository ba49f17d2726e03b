"""Linear peridynamic solid (LPS; Silling et al. 2007; in two dimensions Le, Chan & Schwartz 2014)."""
import math
from dataclasses import dataclass
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.jit import implements
from pdhpc.materials import law as laws
from pdhpc.materials.influence import moment, value
from pdhpc.materials.failure import PairEnergyLimit, critical_pair_energy, stretch_failure
from pdhpc.materials.law import Weighting, influence, influence_over_length, make_weightings, of_pairs, settings_of, smaller_where_both_fail, stretch_limits

CRITICAL_STRETCH_FORMULA = {
    "plane_stress": "s0 = sqrt(G_c / (8 G I4/(pi I3) + (k - 2 G) D)), D = int (2 m_z/m)^2 dz; k = E/(2 (1 - nu))",
    "plane_strain": "s0 = sqrt(G_c / (8 G I4/(pi I3) + (k - 2 G) D)), D = int (2 m_z/m)^2 dz; k = K + G/3",
    "3d": "s0 = sqrt(G_c / (15 G I5/(4 I4) + (K - 5 G/3) D)), D = int (3 m_z/m)^2 dz; nu = 1/4, omega = delta/r: sqrt(5 G_c/(9 K delta))",
}
"""G_c is the energy that a cut takes from bonds stretched to s0 across a plane: theirs, and that of the dilatation they cause.

m is the weighted volume of a point at distance z from the plane and m_z the part of it beyond the plane; I_p = int omega r^p dr.
"""


class LinearSolidLaw(NamedTuple):
    """The LPS law as kernels see it: d is the dimension, k the bulk modulus of d dimensions, m_i = sum_j omega beta |xi|^2 V_j.

    deviatoric (n_block,), d (d+2) G, Pa: a_i = deviatoric/m_i; volumetric (n_block,), 1/Pa: p_i = volumetric a_i^2 sum_j omega beta |xi|^2 s V_j;
    spherical (n_block,), 1/Pa: the energy beside that of bonds is spherical (a_i sum)^2 / 2; bound (n_block,), at least 1: see `stiffness`;
    critical_stretch, break_at (n_block, n_block), see materials/law.py; density (n_block,), kg/m^3.
    """

    deviatoric: np.ndarray
    volumetric: np.ndarray
    spherical: np.ndarray
    bound: np.ndarray
    dilatational: np.ndarray  # (n_block,), 1/Pa: theta_i = dilatational a_i sum
    critical_stretch: np.ndarray
    break_at: np.ndarray
    density: np.ndarray
    weighting: Weighting  # or PairWeighting
    failure: object  # of materials/failure.py


@dataclass(frozen=True)
class LinearSolid:
    """Parameters of an LPS material of any Poisson's ratio.

        theta = d/m sum omega x e V,   t = omega/m [(d k - (d + 2) G) theta x + d (d + 2) G e],   e = |y| - x, x = |xi|
        W = k theta^2 / 2 + d (d + 2) G/(2 m) sum omega (e - theta x/d)^2 V

    3D: d = 3, k = K (Silling et al. 2007, eq. 105); 2D: d = 2, k = K + G/3 in plane strain, k = E/(2 (1 - nu)) in plane stress. Broken bonds leave the sums,
    m stays that of the initial family; t is then still the exact derivative of W = (k - (d+2)G/d) theta^2/2 + d(d+2)G/(2m) sum omega e^2 V.
    bulk_modulus, shear_modulus (of 3D), Pa; density, kg/m^3; energy_release_rate, J/m^2, or critical_stretch, or neither.
    failure : "stretch" or "energy"; stretch_softening : alpha; weibull_modulus, weibull_seed, weibull_length (m) : of the scatter of s0; see
    materials/failure.py.
    Exchanged fields: positions and p_i, see LinearSolidLaw (refresh).
    """

    name: str
    density: float
    bulk_modulus: float
    shear_modulus: float
    energy_release_rate: Optional[float] = None
    critical_stretch: Optional[float] = None
    failure: str = "stretch"
    stretch_softening: float = 0.0
    weibull_modulus: Optional[float] = None
    weibull_seed: int = 1
    weibull_length: float = 0.0

    formula = CRITICAL_STRETCH_FORMULA

    @staticmethod
    def moduli(youngs_modulus, poissons_ratio):
        """Return (K, G) of E and nu."""
        return youngs_modulus / (3 * (1 - 2 * poissons_ratio)), youngs_modulus / (2 * (1 + poissons_ratio))

    def bulk(self, setting):
        """Return k, Pa, with W = k theta^2/2 + G |dev|^2 for in-plane (2D) or all (3D) strains."""
        bulk, shear = self.bulk_modulus, self.shear_modulus
        if setting.dimension == "3d":
            return bulk
        if setting.dimension == "plane_strain":
            return bulk + shear / 3
        return 9 * bulk * shear / (3 * bulk + 4 * shear)  # E/(2 (1 - nu))

    def stretch_limit(self, setting):
        """Return s0: given, or from the energy release rate (see CRITICAL_STRETCH_FORMULA), or infinite."""
        if self.critical_stretch is not None:
            return self.critical_stretch
        if self.energy_release_rate is None:
            return math.inf
        dim = 3 if setting.dimension == "3d" else 2
        moments = [moment(setting.influence, power, setting.horizon) for power in (dim + 1, dim + 2)]
        factor = 15 / 4 if dim == 3 else 8 / math.pi
        deviatoric = factor * self.shear_modulus * moments[1] / moments[0]
        spherical = (self.bulk(setting) - (dim + 2) / dim * self.shear_modulus) * _cut_dilatation(setting.influence, setting.horizon, dim)
        return math.sqrt(self.energy_release_rate / (deviatoric + spherical))

    def wave_speed(self, setting):
        """Return the speed of longitudinal waves, m/s: sqrt((k + 2 (d - 1)/d G)/rho)."""
        dim = 3 if setting.dimension == "3d" else 2
        return math.sqrt((self.bulk(setting) + 2 * (dim - 1) / dim * self.shear_modulus) / self.density)

    @staticmethod
    def law(blocks, setting):
        """Return the LinearSolidLaw of a list of blocks [(LinearSolid, may_fail)]; setting as of BondBased.law.

        At a bond between two materials each end adds its own t; the weighted volumes of both count it by the weighting of the bond.
        """
        settings = settings_of(blocks, setting)
        dim = 3 if settings[0].dimension == "3d" else 2
        bulk = np.array([material.bulk(settings[0]) for material, _ in blocks])
        shear = np.array([material.shear_modulus for material, _ in blocks])
        deviatoric = dim * (dim + 2) * shear
        volumetric = dim * (dim * bulk - (dim + 2) * shear) / deviatoric**2
        spherical = (bulk - (dim + 2) / dim * shear) * (dim / deviatoric) ** 2
        bound = np.maximum(1.0, dim**2 * bulk / deviatoric)
        density = np.array([material.density for material, _ in blocks])
        limits = energy_limits(blocks, setting) if blocks[0][0].failure == "energy" else (*stretch_limits(blocks, setting), stretch_failure(blocks, setting))
        return LinearSolidLaw(deviatoric, volumetric, spherical, bound, dim / deviatoric, *limits[:2], density, make_weightings(settings), limits[2])


def energy_limits(blocks, setting):
    """Return (critical_stretch, break_at, PairEnergyLimit) of blocks: the first two say that bonds which may break do so when stretched, others never."""
    energy = smaller_where_both_fail(blocks, of_pairs(
        blocks, setting, lambda material, between: critical_pair_energy(between, material.energy_release_rate)))
    stretched = np.where(np.isfinite(energy), 0.0, np.inf)
    return stretched, stretched if settings_of(blocks, setting)[0].linear else (1.0 + stretched) ** 2, PairEnergyLimit(energy)


def _cut_dilatation(influence, horizon, dim):
    """Return D = int_0^delta (d m_z/m)^2 dz, m, by Gauss quadrature; m_z sums omega r^2 over the cap beyond the distance z."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    nodes, weights = 0.5 * (nodes + 1), 0.5 * weights
    z = horizon * nodes
    r = z[:, None] + (horizon - z)[:, None] * nodes
    cap = 2 * math.pi * r**2 * (1 - z[:, None] / r) if dim == 3 else 2 * r * np.arccos(z[:, None] / r)
    beyond = (horizon - z) * ((value(influence, r, horizon) * r**2 * cap) @ weights)
    whole = (4 if dim == 3 else 2) * math.pi * moment(influence, dim + 1, horizon)
    return horizon * float(((dim * beyond / whole) ** 2) @ weights)


@implements(laws.bond_weight, LinearSolidLaw)
def _bond_weight(law, weighting, inv_length):
    """omega beta."""
    return influence(weighting, inv_length)


@implements(laws.moment_weight, LinearSolidLaw)
def _moment_weight(law, weighting, inv_length):
    """omega beta r^2."""
    return influence_over_length(weighting, inv_length) / (inv_length * inv_length * inv_length)


@implements(laws.modulus, LinearSolidLaw)
def _modulus(law, block):
    """None: the moduli are in the ends' a and p."""
    return 1.0


@implements(laws.near_end, LinearSolidLaw)
def _near_end(law, points, state, i, j):
    """(a, p) of the particle."""
    return state[i, 0], state[i, 1]


@implements(laws.far_end, LinearSolidLaw)
def _far_end(law, state, j):
    """(a, p) of the neighbour."""
    return state[j, 0], state[j, 1]


@implements(laws.moduli, LinearSolidLaw)
def _moduli(law, near, far):
    """a_i + a_j and p_i + p_j: the pull is omega beta ((a_i + a_j) e + (p_i + p_j) x)/x, along the deformed bond times |xi|/|y|."""
    return near[0] + far[0], near[1] + far[1]


@implements(laws.stiffness, LinearSolidLaw)
def _stiffness(law, block, c):
    """(a_i + a_j) max(1, d k/((d+2) G)): with theta^2 <= d^2/m sum omega e^2 V the spherical part is at most that much more of the bonds' energy."""
    return c * law.bound[block]


@implements(laws.bond_energy, LinearSolidLaw)
def _bond_energy(law, near, moment, s):
    """a_i omega beta e^2 / 2."""
    return 0.5 * near[0] * (moment * s * s)


@implements(laws.volume_energy, LinearSolidLaw)
def _volume_energy(law, near, spherical, total):
    """(k - (d + 2) G/d) theta^2 / 2, theta = d/m total."""
    strained = near[0] * total
    return 0.5 * spherical * strained * strained


@implements(laws.spherical_part, LinearSolidLaw)
def _spherical_part(law, block):
    """Its entry of `spherical`."""
    return law.spherical[block]
