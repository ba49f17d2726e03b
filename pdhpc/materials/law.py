"""What a material's law tells the kernels: empty functions that each law fills in (pdhpc.jit.implements), for floats and for vectors of eight bonds alike.

The pull of a bond is its force density per volume of the neighbour and per length of the vector it acts along: with xi = X_j - X_i, y = xi + u_j - u_i,

    finite:  f_ij = pull y,   stretch = 1 - |xi|/|y|,            shrink = |xi|/|y|,   measure = |y|^2/|xi|^2,
    linear:  f_ij = pull xi,  stretch = xi . (u_j - u_i)/|xi|^2, shrink = 1,          measure = stretch.

A bond breaks when its measure exceeds the law's break_at: (1 + s0)^2 or s0. Comparing |y|^2 needs no square root, so the decision has the same bits on
every processor and at both ends of a bond. Laws whose limit is no number for each pair of blocks: see materials/failure.py.
"""
import math
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements, inlined
from pdhpc.materials.influence import CODES, CONICAL, CONSTANT, INVERSE_DISTANCE


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


class PairWeighting(NamedTuple):
    """The Weighting of bonds between any two blocks, where horizons differ: tables (n_block, n_block), symmetric."""

    horizon: np.ndarray
    ramp_end: np.ndarray
    ramp_slope: np.ndarray
    influence: int


def between(one, other):
    """Return the Setting of bonds between particles of two Settings: horizon and spacing are their means."""
    if one == other:
        return one
    return one._replace(horizon=0.5 * (one.horizon + other.horizon), spacing=0.5 * (one.spacing + other.spacing))


def of_pairs(blocks, setting, quantity):
    """Return (n_block, n_block): quantity(material of the first block, Setting between both); setting: one for all blocks, or a list with one for each."""
    settings, found = settings_of(blocks, setting), {}
    table = np.empty((len(blocks), len(blocks)))
    for i, (material, _) in enumerate(blocks):
        for j, other in enumerate(settings):
            key = material, between(settings[i], other)
            if key not in found:
                found[key] = quantity(*key)
            table[i, j] = found[key]
    return table


def settings_of(blocks, setting):
    """Return the list of Settings of blocks."""
    return [setting] * len(blocks) if isinstance(setting, Setting) else list(setting)


def family_radius(horizon, spacing, volume_correction, influence="constant"):
    """Return the distance up to which particles are bonded, m: delta, or delta + h/2 (excluded) with the linear volume correction.

    The conical influence vanishes at delta: families end before it. The relative slack of 1e-9 keeps lattice neighbours at exactly the limit in or out
    whatever round-off says.
    """
    if influence == "conical":
        return horizon * (1 - 1e-9)
    return (horizon + spacing / 2) * (1 - 1e-9) if volume_correction == "linear" else horizon * (1 + 1e-9)


def reach_of(setting):
    """Return the family radius of a Setting, m."""
    return family_radius(setting.horizon, setting.spacing, setting.volume_correction, setting.influence)


def make_weighting(setting):
    """Return the Weighting of a Setting.

    The linear volume correction counts the share of a neighbour's cell that lies within the horizon: beta falls from 1 at r = delta - h/2 to 0 at
    delta + h/2 (Seleson & Littlewood 2016). The conical influence has no jump at the horizon that would ask for it: beta = 1.
    """
    horizon = float(setting.horizon)
    if setting.volume_correction == "linear" and setting.influence != "conical":
        return Weighting(horizon, horizon + setting.spacing / 2, 1 / setting.spacing, CODES[setting.influence])
    return Weighting(horizon, 4 * horizon, 1 / horizon, CODES[setting.influence])


def make_weightings(settings):
    """Return the Weighting of blocks that share a Setting, else the PairWeighting of a list of one Setting for each block."""
    if all(setting == settings[0] for setting in settings):
        return make_weighting(settings[0])
    pairs = [[make_weighting(between(one, other)) for other in settings] for one in settings]
    tables = (np.array([[getattr(pair, name) for pair in row] for row in pairs]) for name in ("horizon", "ramp_end", "ramp_slope"))
    return PairWeighting(*tables, pairs[0][0].influence)


def stretch_limits(blocks, setting):
    """Return (critical_stretch, break_at), (n_block, n_block) both, of blocks [(material, may_fail)]; setting as of of_pairs.

    s0 of a bond is the smaller of its two materials', at the horizon of the bond; a bond with an end in a block that may not fail never breaks. break_at is s0
    as the kernels compare it.
    """
    limit = of_pairs(blocks, setting, lambda material, between: material.stretch_limit(between))
    pairs = smaller_where_both_fail(blocks, limit)
    return pairs, pairs if settings_of(blocks, setting)[0].linear else (1.0 + pairs) ** 2


def smaller_where_both_fail(blocks, limit):
    """Return (n_block, n_block): the smaller of limit[i, j] and limit[j, i] where both blocks may fail, else infinite."""
    may_fail = np.array([fails for _, fails in blocks])
    return np.where(may_fail[:, None] & may_fail[None, :], np.minimum(limit, limit.T), np.inf)


def weighting_between(weighting, block, other):
    """Return the Weighting of bonds between two blocks."""


@implements(weighting_between, Weighting)
def _one_weighting(weighting, block, other):
    return weighting


@implements(weighting_between, PairWeighting)
def _weighting_of_pair(weighting, block, other):
    return Weighting(weighting.horizon[block, other], weighting.ramp_end[block, other], weighting.ramp_slope[block, other], weighting.influence)


@inlined
def uncorrected(weighting):
    """Return the Weighting without its volume correction: beta = 1 up to three horizons."""
    return Weighting(weighting.horizon, 4.0 * weighting.horizon, 1.0 / weighting.horizon, weighting.influence)


@inlined
def influence_over_length(weighting, inv_length):
    """Return omega(r) beta(r) / r, 1/m, of a bond of length r = 1/inv_length: omega = 1, delta/r, exp(-(r/delta)^2) or max(0, 1 - r/delta)."""
    corrected = min(inv_length, (inv_length * weighting.ramp_end - 1.0) * weighting.ramp_slope)
    if weighting.influence == CONSTANT:
        return corrected
    if weighting.influence == INVERSE_DISTANCE:
        return corrected * (weighting.horizon * inv_length)
    ratio = 1.0 / (weighting.horizon * inv_length)
    if weighting.influence == CONICAL:
        return corrected * (0.0 - min(ratio - 1.0, 0.0))
    return corrected * math.exp(0.0 - ratio * ratio)


@inlined
def influence(weighting, inv_length):
    """Return omega(r) beta(r) of a bond of length r = 1/inv_length."""
    if weighting.influence == INVERSE_DISTANCE:
        return weighting.horizon * min(inv_length, (inv_length * weighting.ramp_end - 1.0) * weighting.ramp_slope)
    return influence_over_length(weighting, inv_length) / inv_length


def bond_weight(law, weighting, inv_length):
    """Return the weight of a bond in the sums below, from its length and the Weighting between its blocks."""


def moment_weight(law, weighting, inv_length):
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
