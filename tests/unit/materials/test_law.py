import math

import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.kernels.simd import load8, store8
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.influence import CODES, value
from pdhpc.materials.law import (
    Setting, Weighting, between, family_radius, influence_over_length, make_weighting, make_weightings, reach_of, stretch_limits,
)
from pdhpc.materials.state_based import LinearSolid


def test_family_radius_ends_where_the_ramp_does():
    assert family_radius(3.0, 1.0, "none") > 3.0 and family_radius(3.0, 1.0, "none") < 3.0 + 1e-6
    assert family_radius(3.0, 1.0, "linear") < 3.5 and family_radius(3.0, 1.0, "linear") > 3.5 - 1e-6
    weighting = make_weighting(Setting("3d", 3.0, 1.0, "constant", 1.0, "linear"))
    beta = [min(1.0, (weighting.ramp_end - r) * weighting.ramp_slope) for r in (2.5, 3.0, 3.5)]
    assert np.allclose(beta, [1.0, 0.5, 0.0])


@kernel
def _weights(weighting, inv_length, one, eight):
    for k in range(len(inv_length)):
        one[k] = influence_over_length(weighting, inv_length[k])
    for k in range(0, len(inv_length), 8):
        store8(eight, k, influence_over_length(weighting, load8(inv_length, k)))


@pytest.mark.parametrize("influence", list(CODES))
@pytest.mark.parametrize("correction", ["linear", "none"])
def test_weights_are_omega_beta_over_r_for_floats_and_vectors(influence, correction):
    horizon, spacing = 3.0, 1.0
    r = np.linspace(0.4, family_radius(horizon, spacing, correction), 64)
    beta = np.minimum(1.0, (horizon + spacing / 2 - r) / spacing) if correction == "linear" and influence != "conical" else 1.0
    one, eight = np.empty(64), np.empty(64)
    _weights(make_weighting(Setting("3d", horizon, 1.0, influence, spacing, correction)), 1 / r, one, eight)
    assert np.allclose(one, value(influence, r, horizon) * beta / r, rtol=1e-13, atol=1e-15)
    assert np.array_equal(one, eight)


@pytest.mark.parametrize("linear", [False, True])
def test_limits_are_compared_as_the_kernels_measure(linear):
    solids = [(BondBased("a", 1.0, 1.0, critical_stretch=0.5), True), (BondBased("b", 1.0, 1.0), True), (BondBased("c", 1.0, 1.0, critical_stretch=0.1), False)]
    limit, break_at = stretch_limits(solids, Setting("3d", 1.0, 1.0, "constant", linear=linear))
    expected = np.array([[0.5, 0.5, math.inf], [0.5, math.inf, math.inf], [math.inf] * 3])  # the weaker end counts; c may not fail
    assert np.array_equal(limit, expected)
    assert np.array_equal(break_at, expected if linear else (1.0 + expected) ** 2)


def test_horizons_that_differ_meet_at_their_mean():
    one = Setting("plane_stress", 3.0, 1.0, "constant", 1.0, "linear")
    other = one._replace(horizon=5.0)
    assert between(one, one) is one and between(one, other).horizon == 4.0
    assert isinstance(make_weightings([one, one]), Weighting)
    pairs = make_weightings([one, other])
    assert pairs.horizon.tolist() == [[3.0, 4.0], [4.0, 5.0]] and pairs.ramp_end.tolist() == [[3.5, 4.5], [4.5, 5.5]] and np.all(pairs.ramp_slope == 1.0)
    conical = one._replace(influence="conical")
    assert reach_of(one) > 3.49 and reach_of(conical) < 3.0 < 1.001 * reach_of(conical), "the conical influence has vanished at the horizon"


@pytest.mark.parametrize("kind, moduli", [(BondBased, ()), (LinearSolid, (0.5,))])
def test_laws_of_several_horizons_are_symmetric_and_calibrated_at_the_bonds_own(kind, moduli):
    one = Setting("plane_stress", 3.0, 1.0, "constant", 1.0, "linear")
    settings = [one, one._replace(horizon=5.0)]
    soft, stiff = kind("soft", 1.0, 1.0, *moduli, 0.1), kind("stiff", 2.0, 3.0, *moduli, 0.2)
    law, middle = kind.law([(soft, True), (stiff, True)], settings), one._replace(horizon=4.0)
    assert law.critical_stretch[0, 1] == law.critical_stretch[1, 0] == min(soft.stretch_limit(middle), stiff.stretch_limit(middle))
    assert [law.critical_stretch[b, b] for b in (0, 1)] == [soft.stretch_limit(settings[0]), stiff.stretch_limit(settings[1])]
    if kind is BondBased:
        ends = [material.micromodulus(middle) for material in (soft, stiff)]
        assert law.micromodulus[0, 1] == law.micromodulus[1, 0] == pytest.approx(2 / (1 / ends[0] + 1 / ends[1]), rel=1e-14)
        assert law.micromodulus[1, 1] == stiff.micromodulus(settings[1])
