import math

import numpy as np
import pytest

from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting

E, G, DELTA, T = 65e9, 204.0, 1e-3, 2e-3
GLASS = BondBased("glass", 2235.0, E, energy_release_rate=G)
PUBLISHED = {  # micromodulus and critical stretch for a constant influence function
    "3d": (12 * E / (math.pi * DELTA**4), math.sqrt(5 * G / (6 * E * DELTA))),
    "plane_stress": (9 * E / (math.pi * T * DELTA**3), math.sqrt(4 * math.pi * G / (9 * E * DELTA))),
    "plane_strain": (48 * E / (5 * math.pi * T * DELTA**3), math.sqrt(5 * math.pi * G / (12 * E * DELTA))),
}


@pytest.mark.parametrize("dimension", list(PUBLISHED))
def test_published_constants(dimension):
    setting = Setting(dimension, DELTA, T, "constant")
    micromodulus, stretch = PUBLISHED[dimension]
    assert GLASS.micromodulus(setting) == pytest.approx(micromodulus, rel=1e-12)
    assert GLASS.stretch_limit(setting) == pytest.approx(stretch, rel=1e-12)


def test_critical_stretch_is_given_derived_or_absent():
    setting = Setting("3d", DELTA, 1.0, "gaussian")
    assert BondBased("a", 1.0, E, critical_stretch=0.02).stretch_limit(setting) == 0.02
    assert math.isinf(BondBased("a", 1.0, E).stretch_limit(setting))
    assert GLASS.stretch_limit(setting) != GLASS.stretch_limit(setting._replace(influence="constant"))


def test_bonds_between_materials_and_blocks():
    soft, stiff = BondBased("soft", 1.0, 1.0, critical_stretch=0.1), BondBased("stiff", 2.0, 3.0, critical_stretch=0.2)
    law = BondBased.law([(soft, True), (stiff, True), (soft, False)], Setting("plane_stress", 1.0, 1.0, "constant", 0.25, "linear"))
    c = np.diag(law.micromodulus)
    assert law.micromodulus[0, 1] == pytest.approx(2 * c[0] * c[1] / (c[0] + c[1])) == law.micromodulus[1, 0]
    assert law.critical_stretch[0, 1] == 0.1 and law.critical_stretch[1, 1] == 0.2
    assert np.all(np.isinf(law.critical_stretch[2])) and np.all(np.isinf(law.critical_stretch[:, 2]))
    assert law.density.tolist() == [1.0, 2.0, 1.0]
