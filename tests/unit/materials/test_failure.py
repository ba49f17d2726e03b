import itertools
import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.failure import EnergyLimit, PairEnergyLimit, ScatteredLimit, SoftenedLimit, StretchLimit, critical_pair_energy
from pdhpc.materials.influence import CODES, value
from pdhpc.materials.law import Setting, reach_of
from pdhpc.materials.state_based import LinearSolid

DIMENSIONS = ("plane_stress", "plane_strain", "3d")


def bond_based(rate, failure="energy", softening=0.0):
    return BondBased("a", 1.0, 2.0, rate, failure=failure, stretch_softening=softening)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_the_bonds_across_a_plane_give_up_the_energy_release_rate(dimension):
    """From depth z below the plane the cap of height delta - z above it is reached; every bond gives up w_c."""
    horizon, thickness, rate = 0.7, 0.3, 5.0
    if dimension == "3d":
        bonds = dblquad(lambda r, z: 2 * math.pi * r**2 * (1 - z / r), 0, horizon, lambda z: z, horizon)[0]
    else:
        bonds = thickness * dblquad(lambda r, z: 2 * r * math.acos(min(1.0, z / r)), 0, horizon, lambda z: z, horizon)[0]
    assert critical_pair_energy(Setting(dimension, horizon, thickness, "constant"), rate) * bonds == pytest.approx(rate, rel=1e-6)
    assert math.isinf(critical_pair_energy(Setting(dimension, horizon, thickness, "constant"), None))


@pytest.mark.parametrize("dimension, influence, linear", list(itertools.product(DIMENSIONS, CODES, (False, True))))
def test_the_bond_based_limit_is_the_critical_energy_and_the_law_knows_the_first(dimension, influence, linear):
    setting = Setting(dimension, 3.0, 1.0, influence, 1.0, "linear", linear)
    law = BondBased.law([(bond_based(5.0), True), (bond_based(5.0), False)], setting)
    assert isinstance(law.failure, EnergyLimit) and np.isinf(law.failure.square[0, 1]) and np.isinf(law.break_at[1, 1])
    r = np.linspace(0.5, reach_of(setting), 2001)
    omega = value(influence, r, 3.0)
    stretch = np.sqrt(law.failure.square[0, 0] / (omega * r))
    assert np.allclose(0.5 * law.micromodulus[0, 0] * omega * stretch**2 * r, critical_pair_energy(setting, 5.0), rtol=1e-12)
    assert law.critical_stretch[0, 0] <= stretch.min() <= law.critical_stretch[0, 0] * 1.001
    assert law.break_at[0, 0] == pytest.approx(law.critical_stretch[0, 0] if linear else (1 + law.critical_stretch[0, 0]) ** 2, rel=1e-15)


def test_between_two_materials_the_one_that_breaks_first_counts():
    weak, tough = bond_based(1.0), bond_based(4.0)
    law = BondBased.law([(weak, True), (tough, True)], Setting("3d", 1.0, 1.0, "constant"))
    assert law.failure.square[0, 1] == law.failure.square[1, 0] == law.failure.square[0, 0] == pytest.approx(law.failure.square[1, 1] / 4)


def test_state_based_energies():
    solid = LinearSolid("a", 1.0, 2.0, 1.0, 5.0, failure="energy")
    setting = Setting("plane_strain", 2.0, 0.5, "gaussian")
    law = LinearSolid.law([(solid, True), (solid, False)], setting)
    assert isinstance(law.failure, PairEnergyLimit) and law.failure.energy[0, 0] == critical_pair_energy(setting, 5.0) and np.isinf(law.failure.energy[0, 1])
    assert law.critical_stretch[0, 0] == 0.0 and law.break_at[0, 0] == 1.0 and np.isinf(law.break_at[1, 1]), "only stretched bonds break"


@pytest.mark.parametrize("kind, moduli", [(BondBased, (2.0,)), (LinearSolid, (2.0, 1.0))])
def test_softening_where_a_material_asks_for_it(kind, moduli):
    setting = Setting("3d", 1.0, 1.0, "constant")
    plain, soft = kind("a", 1.0, *moduli, critical_stretch=0.1), kind("b", 1.0, *moduli, critical_stretch=0.1, stretch_softening=0.25)
    assert isinstance(kind.law([(plain, True)], setting).failure, StretchLimit)
    law = kind.law([(plain, True), (soft, True)], setting)
    assert isinstance(law.failure, SoftenedLimit) and law.failure.softening.tolist() == [0.0, 0.25] and law.critical_stretch[0, 1] == 0.1


@pytest.mark.parametrize("kind, moduli", [(BondBased, (2.0,)), (LinearSolid, (2.0, 1.0))])
def test_scatter_where_a_material_asks_for_it(kind, moduli):
    """Each end has the critical stretch of its own material; the mean of scale (-ln U)^(1/m) is scale Gamma(1 + 1/m) = 1."""
    setting = Setting("3d", 1.0, 1.0, "constant")
    plain = kind("a", 1.0, *moduli, critical_stretch=0.1)
    loose = kind("b", 1.0, *moduli, critical_stretch=0.2, weibull_modulus=2.0, weibull_seed=7, weibull_length=0.5)
    law = kind.law([(plain, True), (loose, True), (loose, False)], setting)
    assert isinstance(law.failure, ScatteredLimit) and law.critical_stretch[0, 1] == 0.1
    assert np.array_equal(law.failure.own, [[0.1, 0.1, np.inf], [0.2, 0.2, np.inf], [np.inf] * 3]) and law.failure.lowest.tolist() == [0.1, 0.2, np.inf, 0.1]
    assert law.failure.modulus.tolist() == [np.inf, 2.0, 2.0] and law.failure.scale == pytest.approx([1.0, 2 / math.sqrt(math.pi), 2 / math.sqrt(math.pi)])
    assert law.failure.seed.tolist() == [1, 7, 7] and law.failure.grain.tolist() == [0.0, 0.5, 0.5]
