"""What a material's law tells the kernels: empty functions that each law fills in (pdhpc.jit.implements), for floats and for vectors of eight bonds alike.

The pull of a bond is its force density per volume of the neighbour and per length of the vector it acts along: with xi = X_j - X_i, y = xi + u_j - u_i,

    finite:  f_ij = pull y,   stretch = 1 - |xi|/|y|,            shrink = |xi|/|y|,   measure = |y|^2/|xi|^2,
    linear:  f_ij = pull xi,  stretch = xi . (u_j - u_i)/|xi|^2, shrink = 1,          measure = stretch.

A bond breaks when its measure exceeds the law's break_at: (1 + s0)^2 or s0. Comparing |y|^2 needs no square root, so the decision has the same bits on
every processor and at both ends of a bond.
"""
import math
from typing import NamedTuple

import numpy as np

from pdhpc.jit import inlined
from pdhpc.materials.influence import CODES, CONSTANT, INVERSE_DISTANCE


class Setting(NamedTuple):
    """What calibration needs beside the material.

    dimension ("plane_stress", "plane_strain", "3d"); horizon, m; thickness, m; influence by name; spacing, m; volume_correction ("linear", "none");
    linear: kinematics.
    """

    dimension: str
    horizon: float
    thickness: float
    influence: str
    spacing: float = 0.0
    volume_correction: str = "none"
    linear: bool = False


class Weighting(NamedTuple):
    """omega(r) beta(r): influence (code), horizon, m, and the volume correction beta = min(1, (ramp_end - r) ramp_slope), m and 1/m."""

    horizon: float
    ramp_end: float
    ramp_slope: float
    influence: int


def family_radius(horizon, spacing, volume_correction):
    """Return the distance up to which particles are bonded, m: delta, or delta + h/2 (excluded) with the linear volume correction.

    The relative slack of 1e-9 keeps lattice neighbours at exactly the limit in or out whatever round-off says.
    """
    return (horizon + spacing / 2) * (1 - 1e-9) if volume_correction == "linear" else horizon * (1 + 1e-9)


def make_weighting(setting):
    """Return the Weighting of a Setting.

    The linear volume correction counts the share of a neighbour's cell that lies within the horizon: beta falls from 1 at r = delta - h/2 to 0 at
    delta + h/2 (Seleson & Littlewood 2016).
    """
    horizon = float(setting.horizon)
    if setting.volume_correction == "linear":
        return Weighting(horizon, horizon + setting.spacing / 2, 1 / setting.spacing, CODES[setting.influence])
    return Weighting(horizon, 4 * horizon, 1 / horizon, CODES[setting.influence])


def stretch_limits(blocks, setting):
    """Return (critical_stretch, break_at), (n_block, n_block) both, of blocks [(material, may_fail)].

    s0 of a bond is the smaller of its two ends'; a bond with an end in a block that may not fail never breaks. break_at is s0 as the kernels compare it.
    """
    limit = np.array([material.stretch_limit(setting) for material, _ in blocks])
    may_fail = np.array([fails for _, fails in blocks])
    pairs = np.where(may_fail[:, None] & may_fail[None, :], np.minimum(limit[:, None], limit[None, :]), np.inf)
    return pairs, pairs if setting.linear else (1.0 + pairs) ** 2


@inlined
def influence_over_length(weighting, inv_length):
    """Return omega(r) beta(r) / r, 1/m, of a bond of length r = 1/inv_length: omega = 1, delta/r or exp(-(r/delta)^2)."""
    corrected = min(inv_length, (inv_length * weighting.ramp_end - 1.0) * weighting.ramp_slope)
    if weighting.influence == CONSTANT:
        return corrected
    if weighting.influence == INVERSE_DISTANCE:
        return corrected * (weighting.horizon * inv_length)
    ratio = 1.0 / (weighting.horizon * inv_length)
    return corrected * math.exp(0.0 - ratio * ratio)


@inlined
def influence(weighting, inv_length):
    """Return omega(r) beta(r) of a bond of length r = 1/inv_length."""
    if weighting.influence == INVERSE_DISTANCE:
        return weighting.horizon * min(inv_length, (inv_length * weighting.ramp_end - 1.0) * weighting.ramp_slope)
    return influence_over_length(weighting, inv_length) / inv_length


def bond_weight(law, inv_length):
    """Return the weight of a bond in the sums below, from its length alone."""


def moment_weight(law, inv_length):
    """Return the weight times |xi|^2: that of a bond in weighted volumes and dilatations."""


def modulus(law, block):
    """Return the factor in the pull of every bond within a block: `near_end`, for laws whose near end is but that, else 1."""


def near_end(law, points, state, i, j):
    """Return what `pull` needs of particle i, bonded to j."""


def far_end(law, state, j):
    """Return what `pull` needs of the neighbour j."""


def moduli(law, near, far):
    """Return (C, P) of a bond: what it pulls with per unit of stretch, and unstretched; see `pull`."""


@inlined
def pull(law, near, far, weight, stretch, shrink):
    """Return weight (C stretch + P shrink), the pull of a bond, N/m^7; see the top of this module."""
    c, p = moduli(law, near, far)
    return weight * (c * stretch + p * shrink)


def stiffness(law, block, c):
    """Return what to replace C by so that no motion stores more energy than bonds of micropotential C weight s^2 |xi|^2 / 2 would."""


def bond_energy(law, near, moment, s):
    """Return particle i's part of a bond's energy density, J/m^6; moment: its moment_weight."""


def volume_energy(law, near, spherical, total):
    """Return the energy density of a particle beside that of its bonds, J/m^3; total = sum_j moment_weight s V_j; spherical: of its block."""


def spherical_part(law, block):
    """Return what `volume_energy` needs of a block."""


def released_stretch(law, stretch, limit):
    """Return the stretch at which a bond that breaks gives up its energy."""
