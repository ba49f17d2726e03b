"""The loop bond by bond against a body worked out by hand; test_cloud.py compares it with the vector loop on random clouds."""
import subprocess
import sys

import numpy as np
import pytest

from pdhpc.kernels import cloud, reference
from pdhpc.kernels.neighbours import find_bonds
from pdhpc.materials.bond_based import BondBased, Setting, make_law


def _pair(stretch, critical):
    """Two particles of 0.5 m^3 and 0.25 m^3, 2 m apart along x, the right one moved so that the bond has the given stretch."""
    x = np.array([[0.0, 0.0], [2.0, 0.0]])
    position = x.copy()
    position[1, 0] += 2.0 * stretch
    law = make_law([(BondBased("a", 1.0, 1.0, critical_stretch=critical), True)], Setting("plane_stress", 3.0, 1.0, "constant"), 1.0, "none")
    bonds, _ = find_bonds(x, np.arange(2), 2, 3.0)
    points = cloud.PointArrays(x, position, np.array([0.5, 0.25]), np.zeros(2, np.uint8), np.full(2, cloud.MIXED, np.uint8))
    return points, bonds, law, False, None, (0, 2), np.full((2, 2), np.nan), np.zeros(2)


def test_a_stretched_bond_pulls_its_ends_together():
    arguments = _pair(0.125, critical=0.5)
    assert reference.bond_forces(*arguments) == 0
    pull = arguments[2].micromodulus[0, 0] * 0.125  # c s, N/m^6
    assert arguments[6] == pytest.approx(np.array([[pull * 0.25, 0.0], [-pull * 0.5, 0.0]]), rel=1e-15)  # times the other end's volume
    assert np.all(arguments[7] == 0.0)


def test_a_bond_beyond_its_limit_breaks_at_both_ends_and_pulls_no_more():
    arguments = _pair(0.625, critical=0.5)
    assert reference.bond_forces(*arguments) == 2
    assert np.all(arguments[6] == 0.0)
    assert not arguments[1].alive.any()
    energy = 0.5 * arguments[2].micromodulus[0, 0] * 0.5**2 * 2.0  # c s0^2 r / 2, J/m^6
    assert arguments[7] == pytest.approx(np.full(2, 0.5 * energy * 0.5 * 0.25), rel=1e-15)


def test_both_ends_find_the_same_stretch():
    random = np.random.default_rng(3)
    x = random.random((60, 3))
    bonds, sizes = find_bonds(x, np.arange(60), 60, 0.5)
    table = np.zeros((60, 4))
    table[:, :3] = x
    position = table + 1e-2 * random.standard_normal((60, 4))
    points = cloud.PointArrays(table, position, np.ones(60), np.zeros(60, np.uint8), np.zeros(60, np.uint8))
    for linear in (False, True):
        found = {}
        for i in range(60):
            for k in range(bonds.row_start[i], bonds.row_start[i] + sizes[i]):
                found[i, bonds.neighbour[k]] = reference.bond_stretch(i, k, points, bonds, linear, 2)[0]
        assert len(found) > 500
        assert all(found[i, j] == found[j, i] for i, j in found)


@pytest.mark.parametrize("choice, function", [("reference", True), ("vector", False)])
def test_the_environment_chooses_the_loop(choice, function, monkeypatch):
    monkeypatch.setenv("PDHPC_KERNELS", choice)
    code = "from pdhpc.kernels import cloud, reference; print(cloud.bond_forces is reference.bond_forces)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(function)
