"""Whether a bond breaks, asked of the damage laws of materials/failure.py: bond by bond, which decides, and eight bonds at a time, which may say yes early.

The decision has the same bits at both ends of a bond: everything it uses is the same, or enters symmetrically.
"""
import numpy as np

from pdhpc.jit import implements, inlined
from pdhpc.kernels.family import stretch_of
from pdhpc.kernels.simd import at, both, gather8, lane_mask, load8, root8
from pdhpc.materials.failure import EnergyLimit, PairEnergyLimit, ScatteredLimit, SoftenedLimit, StretchLimit
from pdhpc.materials.law import far_end, influence_over_length, moduli, near_end, uncorrected, weighting_between

_EARLY = 1e-9  # relative: how much before its limit a bond is looked at closely


def limit_stretch(failure, law, points, i, j, inv_l):
    """Return the stretch beyond which the bond of length 1/inv_l between particles i and j breaks, where its stretch alone decides."""


def released_stretch(failure, law, points, state, i, j, inv_l, s):
    """Return the stretch at which a bond that fails at the stretch s gives up its energy: that of its limit.

    The bond passed it during the step, on average in the middle. There Verlet's balance takes its energy: that of the step's start less half the work that
    its force would have done in the step. Its energy at the step's end would be too much, by first order in the step.
    """


def fails(failure, law, points, state, i, j, inv_l, measure, linear):
    """Return whether the bond of length 1/inv_l and `measure` (materials/law.py) between particles i and j is beyond its limit."""


def fails_by_strain(failure, law, points, i, j, inv_l, measure, linear):
    """As `fails`, before the state of the particles is known: False where that decides."""


def limit_of_block(failure, law, block):
    """Return the limit that beyond_of_eight compares with, of bonds within a block."""


def limit_of_eight(failure, limit, points, i, neighbour, k, linear):
    """Return what beyond_of_eight compares with of eight bonds of particle i, of a cloud, to the neighbours in slots k ... k + 7, from limit_of_block."""


def trigger_of_eight(failure, bonds, points, i, j, row, k, linear):
    """Return the trigger (LatticeArrays) of bond k of eight particles of a lattice from slot i on, their neighbours from slot j on; row: of the table."""


def beyond_of_eight(failure, law, limit, weighting, near, far, inv_l, measure, linear):
    """Return which of eight bonds within a block may be beyond their limits; near, far, inv_l, measure: of each."""


def strained_of_eight(failure, limit, measure):
    """As beyond_of_eight, before the state of the particles is known."""


@implements(limit_stretch, StretchLimit)
def _limit(failure, law, points, i, j, inv_l):
    return law.critical_stretch[points.block[i], points.block[j]]


@implements(limit_stretch, SoftenedLimit)
def _raised_limit(failure, law, points, i, j, inv_l):
    return law.critical_stretch[points.block[i], points.block[j]] + min(points.raised[i], points.raised[j])


@implements(limit_stretch, ScatteredLimit)
def _scattered_limit(failure, law, points, i, j, inv_l):
    near, far = points.block[i], points.block[j]
    return min(points.strength[i] * failure.own[near, far], points.strength[j] * failure.own[far, near])


@implements(limit_stretch, EnergyLimit)
def _limit_of_energy(failure, law, points, i, j, inv_l):
    weighting = uncorrected(weighting_between(law.weighting, points.block[i], points.block[j]))
    return np.sqrt(failure.square[points.block[i], points.block[j]] * inv_l * inv_l / influence_over_length(weighting, inv_l))


@implements(fails, StretchLimit)
def _fails(failure, law, points, state, i, j, inv_l, measure, linear):
    return measure > law.break_at[points.block[i], points.block[j]]


@inlined
def _measure_of(stretch, linear):
    """Return the measure of a bond at a stretch."""
    return stretch if linear is not None else (1.0 + stretch) * (1.0 + stretch)


@inlined
def _beyond(limit, measure, linear):
    """Return whether a measure is beyond that of a stretch."""
    return measure > _measure_of(limit, linear)


@implements(fails, SoftenedLimit)
def _fails_when_raised(failure, law, points, state, i, j, inv_l, measure, linear):
    return _beyond(limit_stretch(failure, law, points, i, j, inv_l), measure, linear)


@implements(fails, ScatteredLimit)
def _fails_when_scattered(failure, law, points, state, i, j, inv_l, measure, linear):
    return _beyond(limit_stretch(failure, law, points, i, j, inv_l), measure, linear)


@implements(fails, EnergyLimit)
def _fails_by_energy(failure, law, points, state, i, j, inv_l, measure, linear):
    return _beyond(limit_stretch(failure, law, points, i, j, inv_l), measure, linear)


@implements(fails, PairEnergyLimit)
def _fails_by_pair_energy(failure, law, points, state, i, j, inv_l, measure, linear):
    s = stretch_of(measure, linear)
    c, p = moduli(law, near_end(law, points, state, i, j), far_end(law, state, j))
    weighting = weighting_between(law.weighting, points.block[i], points.block[j])
    return s > 0.0 and pair_energy(weighting, inv_l, s, c, p) > failure.energy[points.block[i], points.block[j]]


@implements(released_stretch, PairEnergyLimit)
def _released_at_pair_energy(failure, law, points, state, i, j, inv_l, s):
    """s sqrt(w_c/w): its energy w is a quadratic form of the strain around it."""
    c, p = moduli(law, near_end(law, points, state, i, j), far_end(law, state, j))
    energy = pair_energy(weighting_between(law.weighting, points.block[i], points.block[j]), inv_l, s, c, p)
    return s * np.sqrt(failure.energy[points.block[i], points.block[j]] / energy)


@inlined
def pair_energy(weighting, inv_l, s, c, p):
    """Return w = omega r^2 s (C s + P)/2 of a state-based bond, J/m^6: half its pull times its elongation, without volume correction."""
    return 0.5 * (influence_over_length(uncorrected(weighting), inv_l) / (inv_l * inv_l * inv_l)) * (s * (c * s + p))


@implements(beyond_of_eight, PairEnergyLimit)
def _beyond_pair_energy(failure, law, limit, weighting, near, far, inv_l, measure, linear):
    s = measure if linear is not None else root8(measure) - 1.0
    c, p = moduli(law, near, far)
    return both(s > 0.0, pair_energy(weighting, inv_l, s, c, p) > limit)


@implements(limit_of_block, PairEnergyLimit)
def _energy_of_block(failure, law, block):
    return failure.energy[block, block] * (1.0 - _EARLY)


@implements(strained_of_eight, PairEnergyLimit)
def _never(failure, limit, measure):
    return lane_mask(np.uint8(0))


@implements(fails_by_strain, PairEnergyLimit)
def _fails_later(failure, law, points, i, j, inv_l, measure, linear):
    return False


def _decide_by_stretch(record):
    """Let a limit of stretch, of which the law's break_at is the lowest, be the same whether or not the state is known."""

    @implements(fails_by_strain, record)
    def _fails_by_strain(failure, law, points, i, j, inv_l, measure, linear):
        return fails(failure, law, points, None, i, j, inv_l, measure, linear)

    @implements(released_stretch, record)
    def _released_at_limit(failure, law, points, state, i, j, inv_l, s):
        return limit_stretch(failure, law, points, i, j, inv_l)

    @implements(beyond_of_eight, record)
    def _beyond_limit(failure, law, limit, weighting, near, far, inv_l, measure, linear):
        return measure > limit

    @implements(strained_of_eight, record)
    def _strained(failure, limit, measure):
        return measure > limit


def _know_lowest(record):
    """Let the law's break_at be the lowest limit of all bonds within a block."""

    @implements(limit_of_block, record)
    def _lowest_limit(failure, law, block):
        return law.break_at[block, block]


def _limit_blocks(record):
    """Let all bonds within a block be compared with one limit."""

    @implements(limit_of_eight, record)
    def _limit_of_their_block(failure, limit, points, i, neighbour, k, linear):
        return limit

    @implements(trigger_of_eight, record)
    def _trigger_of_their_block(failure, bonds, points, i, j, row, k, linear):
        return at(bonds.trigger, row * len(bonds.offset) + k)


for _record in (StretchLimit, SoftenedLimit, EnergyLimit, ScatteredLimit):
    _decide_by_stretch(_record)
for _record in (StretchLimit, SoftenedLimit, EnergyLimit):
    _know_lowest(_record)
for _record in (StretchLimit, SoftenedLimit, EnergyLimit, PairEnergyLimit):
    _limit_blocks(_record)


@implements(limit_of_block, ScatteredLimit)
def _unscattered(failure, law, block):
    return failure.lowest[block]


@implements(limit_of_eight, ScatteredLimit)
def _scattered_of_eight(failure, limit, points, i, neighbour, k, linear):
    return _measure_of(limit * min(points.strength[i], gather8(points.strength, neighbour, k)), linear) * (1.0 - _EARLY)


@implements(trigger_of_eight, ScatteredLimit)
def _scattered_trigger(failure, bonds, points, i, j, row, k, linear):
    limit = _measure_of(failure.lowest[row] * min(load8(points.strength, i), load8(points.strength, j)), linear)
    return limit * (at(bonds.length, k) * at(bonds.length, k) * (1.0 - _EARLY))
