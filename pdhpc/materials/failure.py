"""When a bond breaks: damage laws as records that kernels read (kernels/failure.py); every law of materials/ holds one as `failure`.

`StretchLimit`: beyond the critical stretch s0 of its two blocks (Silling & Askari 2005). `SoftenedLimit`: the critical stretch of a particle rises with the
compression of its most compressed bond, s0_i = s00 - alpha min(0, s_min,i), and the lower one of both ends counts (Silling & Askari 2005; LAMMPS,
pair_style peri). `ScatteredLimit`: the critical stretch of a particle is s0 times a factor drawn from a Weibull distribution, for itself or for the grain it lies
in, and the lower one of both ends counts. `EnergyLimit` and `PairEnergyLimit`: a stretched bond breaks when it stores the energy density w_c (Foster, Silling & Chen 2011):
bond-based, w = c omega s^2 r/2, a critical stretch s0(r) = sqrt(2 w_c/(c omega r)); state-based, w = 1/2 (pull . eta) from the state of both ends.
"""
import math
from typing import NamedTuple

import numpy as np

from pdhpc.materials.law import of_pairs

PAIR_ENERGY_FORMULA = {
    "plane_stress": "w_c = 3 G/(2 t delta^3)", "plane_strain": "w_c = 3 G/(2 t delta^3)", "3d": "w_c = 4 G/(pi delta^4) (Foster, Silling & Chen 2011)",
}
"""Every bond that crosses a plane gives up w_c: G = w_c int_0^delta N(z) dz, with N(z) the measure of bonds from a point at distance z across the plane.

3D: int_0^delta int_z^delta 2 pi r^2 (1 - z/r) dr dz = pi delta^4/4; 2D: t int_0^delta int_z^delta 2 r arccos(z/r) dr dz = 2 t delta^3/3.
"""


class StretchLimit(NamedTuple):
    """Bonds break beyond the law's break_at."""

    unused: int = 0


class SoftenedLimit(NamedTuple):
    """Bonds break beyond critical_stretch + min(raised_i, raised_j), raised_i = -alpha min(0, s_min,i) (PointArrays.raised); softening (n_block,): alpha."""

    softening: np.ndarray


class ScatteredLimit(NamedTuple):
    """Bonds break beyond min(f_i own[block_i, block_j], f_j own[block_j, block_i]), f the factors of particles (PointArrays.strength, kernels/strength.py).

    own (n_block, n_block): s0 of the first block's material at the horizon of the bond, inf where bonds never break; lowest (n_block + 1,): own within each
    block, and last the least of all.
    f = scale (-ln U)^(1/modulus), scale = 1/Gamma(1 + 1/modulus): a Weibull distribution of mean 1 (Weibull 1951); modulus, scale (n_block,), an infinite modulus
    means f = 1. U, uniform in (0, 1), is a hash of the seed (n_block,) uint64 and of the particle's id or, where grain (n_block,), m, is above 0, of the
    grain of that size that it lies in.
    """

    own: np.ndarray
    lowest: np.ndarray
    modulus: np.ndarray
    scale: np.ndarray
    seed: np.ndarray
    grain: np.ndarray


class EnergyLimit(NamedTuple):
    """Bond-based bonds break beyond the stretch sqrt(square/(omega r)); square (n_block, n_block), m: 2 w_c/c, inf where bonds never break."""

    square: np.ndarray


class PairEnergyLimit(NamedTuple):
    """State-based bonds that are stretched break when they store more than energy (n_block, n_block), J/m^6 in 3D, of any law's near and far ends."""

    energy: np.ndarray


def critical_pair_energy(setting, energy_release_rate):
    """Return w_c, J/m^6, of a Setting and G, J/m^2 (None: infinite); see PAIR_ENERGY_FORMULA."""
    if energy_release_rate is None:
        return math.inf
    if setting.dimension == "3d":
        return 4 * energy_release_rate / (math.pi * setting.horizon**4)
    return 3 * energy_release_rate / (2 * setting.thickness * setting.horizon**3)


def stretch_failure(blocks, setting):
    """Return the StretchLimit or, where a material of blocks [(material, may_fail)] has a weibull_modulus or a stretch_softening, the limit of that; setting as of
    law.of_pairs.
    """
    if any(material.weibull_modulus is not None for material, _ in blocks):
        may_fail = np.array([fails for _, fails in blocks])
        own = of_pairs(blocks, setting, lambda material, between: material.stretch_limit(between))
        own = np.where(may_fail[:, None] & may_fail[None, :], own, np.inf)
        modulus = np.array([material.weibull_modulus or math.inf for material, _ in blocks])
        scale = np.array([1 / math.gamma(1 + 1 / m) for m in modulus])
        seed, grain = np.array([material.weibull_seed for material, _ in blocks], np.uint64), np.array([material.weibull_length for material, _ in blocks], float)
        return ScatteredLimit(own, np.append(np.diag(own), own.min()), modulus, scale, seed, grain)
    softening = np.array([float(material.stretch_softening) for material, _ in blocks])
    return SoftenedLimit(softening) if softening.any() else StretchLimit()
