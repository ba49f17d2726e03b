"""The loop bond by bond against bodies worked out by hand; test_sweeps.py and test_cloud.py compare it with the vector loops."""
import itertools
import subprocess
import sys

import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.kernels import family, reference, sweeps
from pdhpc.kernels.neighbours import find_bonds
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting
from pdhpc.materials.state_based import LinearSolid
from pdhpc.warm_up import PATHS, block


def _pair(stretch, critical, model="pmb"):
    """Two particles of 0.5 m^3 and 0.25 m^3, 2 m apart along x, the right one moved so that the bond has the given stretch."""
    x = np.array([[0.0, 0.0], [2.0, 0.0]])
    position = x.copy()
    position[1, 0] += 2.0 * stretch
    material = BondBased("a", 1.0, 1.0, critical_stretch=critical) if model == "pmb" else LinearSolid("a", 1.0, 3.0, 1.0, critical_stretch=critical)
    law = type(material).law([(material, True)], Setting("plane_strain", 3.0, 1.0, "constant", 0.5))
    bonds, _ = find_bonds(x, np.arange(2), 2, 3.0)
    points = family.PointArrays(x, position, np.array([0.5, 0.25]), np.zeros(2, np.uint8), np.full(2, family.MIXED, np.uint8))
    state = None if model == "pmb" else np.zeros((2, 2))
    return bonds, points, law, state, None, None, np.arange(2, dtype=np.int32), np.full((2, 2), np.nan), np.zeros(2)


def test_a_stretched_bond_pulls_its_ends_together():
    arguments = _pair(0.125, critical=0.5)
    assert reference.bond_forces(*arguments) == 0
    pull = arguments[2].micromodulus[0, 0] * 0.125  # c s, N/m^6
    assert arguments[7] == pytest.approx(np.array([[pull * 0.25, 0.0], [-pull * 0.5, 0.0]]), rel=1e-15)  # times the other end's volume
    assert np.all(arguments[8] == 0.0)


def test_a_bond_beyond_its_limit_breaks_at_both_ends_and_pulls_no_more():
    arguments = _pair(0.625, critical=0.5)
    assert reference.bond_forces(*arguments) == 2
    assert np.all(arguments[7] == 0.0)
    assert not arguments[0].alive.any()
    energy = 0.5 * arguments[2].micromodulus[0, 0] * 0.5**2 * 2.0  # c s0^2 r / 2, J/m^6
    assert arguments[8] == pytest.approx(np.full(2, 0.5 * energy * 0.5 * 0.25), rel=1e-15)


def test_two_particles_of_a_linear_solid():
    """The only bond is each particle's whole family: theta = d s, t = (d k - (d + 2) G) theta/V r + d (d + 2) G s/(V r), with V the other's volume."""
    arguments = _pair(0.125, critical=0.5, model="lps")
    bonds, points, law, state, linear, third, rows, force, dissipated = arguments
    sweeps.weighted_volumes(bonds, points, law, rows, state)
    assert state[:, 0] == pytest.approx([8.0 * 1.0 / (4.0 * 0.25), 8.0 / (4.0 * 0.5)], rel=1e-15)  # d (d + 2) G/m, m = r^2 V
    assert reference.dilatations(bonds, points, law, state, linear, third, rows, dissipated) == 0
    k, theta = 3.0 + 1.0 / 3.0, 2 * 0.125  # plane strain: k = K + G/3
    t = [((2 * k - 4.0) * theta * 2.0 + 8.0 * 0.25) / (4.0 * volume) for volume in (0.25, 0.5)]  # omega = 1, x = 2, e = 0.25
    assert reference.bond_forces(*arguments) == 0
    assert force == pytest.approx(np.array([[sum(t) * 0.25, 0.0], [-sum(t) * 0.5, 0.0]]), rel=1e-14)


def test_a_linear_solid_that_breaks_apart_dissipates_what_it_held_at_the_limit():
    bonds, points, law, state, linear, third, rows, force, dissipated = arguments = _pair(0.625, critical=0.5, model="lps")
    sweeps.weighted_volumes(bonds, points, law, rows, state)
    assert reference.dilatations(bonds, points, law, state, linear, third, rows, dissipated) == 2
    assert reference.bond_forces(*arguments) == 0 and np.all(force == 0.0) and np.all(state[:, 1] == 0.0) and not bonds.alive.any()
    # s0 = 0.5 of a lone bond: theta = 2 s0 and no deviator, W = k theta^2/2 + d (d + 2) G/(2 m) (e - theta x/d)^2 = k (2 s0)^2/2
    assert dissipated == pytest.approx(0.5 * (3.0 + 1.0 / 3.0) * 1.0**2 * np.array([0.5, 0.25]), rel=1e-14)


@kernel
def _measures(bonds, points, linear, third, slots, found):
    count = 0
    for n in range(len(slots)):
        i = slots[n]
        for k in range(family.first_bond(bonds, i), family.end_of_bonds(bonds, i)):
            if family.is_alive(bonds, i, k):
                j = family.neighbour(bonds, i, k)
                found[count, 0], found[count, 1] = i, j
                found[count, 2] = family.bond_strain(bonds, points, i, j, k, linear, third)[0]
                count += 1
    return count


@pytest.mark.parametrize("path, dim, linear", list(itertools.product(PATHS, (2, 3), (False, True))))
def test_both_ends_find_the_same_measure(path, dim, linear):
    subdomain, _ = block(dim, 6, 2.0, linear, path)
    particles = subdomain.particles
    particles.put(particles.displacement, 1e-4 * np.random.default_rng(3).standard_normal((particles.n_owned, dim)))
    particles.place()
    rows = np.empty((subdomain.bonds.n_directed, 3))
    assert _measures(subdomain.bonds.arrays, subdomain.points, particles.linear, particles.third, particles.slots, rows) == len(rows)
    found = {(int(i), int(j)): measure for i, j, measure in rows}
    assert len(found) == len(rows) > 300
    assert all(found[i, j] == found[j, i] for i, j in found)


@pytest.mark.parametrize("choice, function", [("reference", True), ("vector", False), ("ieee", False)])
def test_the_environment_chooses_the_loop(choice, function, monkeypatch):
    monkeypatch.setenv("PDHPC_KERNELS", choice)
    code = "from pdhpc.kernels import reference, sweeps; print(sweeps.bond_forces is reference.bond_forces, sweeps.dilatations is reference.dilatations)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(function)] * 2
