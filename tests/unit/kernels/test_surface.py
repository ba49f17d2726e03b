import numpy as np
import pytest

from pdhpc.kernels import surface
from pdhpc.kernels.family import PointArrays
from pdhpc.kernels.neighbours import find_bonds
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting


@pytest.mark.parametrize("dim", [2, 3])
def test_energies_and_volumes_by_sums_over_pairs(dim):
    random, n = np.random.default_rng(3), 150
    x, volume = random.uniform(0, 3, (n, dim)), random.uniform(0.1, 0.2, n)
    block = (x[:, 0] > 1.5).astype(np.uint8)
    one = Setting("3d" if dim == 3 else "plane_strain", 0.9, 1.0, "inverse_distance", 0.2, "linear")
    settings = [one, one._replace(horizon=1.1)]
    soft, stiff = BondBased("soft", 1.0, 1.0), BondBased("stiff", 1.0, 3.0)
    law = BondBased.law([(soft, True), (stiff, True)], settings)
    horizon = np.array([[0.9, 1.0], [1.0, 1.1]])
    bonds, _ = find_bonds(x, np.arange(n), n, horizon + 0.1, block)
    reference = np.zeros((n, 2 if dim == 2 else 4))
    reference[:, :dim] = x
    points, slots = PointArrays(reference, reference, volume, block, np.full(n, 255, np.uint8)), np.arange(n, dtype=np.int32)
    own, whole = np.array([[2.0, 3.0], [4.0, 5.0]]), np.array([[1.0, 2.0], [2.0, 4.0]])
    energy, share = np.empty((n, dim)), np.empty((n, 1))
    surface.directional_energies(bonds, points, law, own, None if dim == 2 else 2, slots, energy)
    surface.family_shares(bonds, points, law, whole, slots, share)
    for i in range(0, n, 7):
        xi = np.delete(x - x[i], i, axis=0)
        other, v, r = np.delete(block, i), np.delete(volume, i), np.linalg.norm(xi, axis=1)
        delta = horizon[block[i], other]
        near = r <= delta + 0.1
        beta = np.minimum(1.0, (delta + 0.1 - r) / 0.2)
        part = 0.25 * own[block[i], other] * delta / r * beta * r * v
        assert np.allclose(energy[i], (part[:, None] * (xi / r[:, None]) ** 4)[near].sum(axis=0), rtol=1e-12)
        assert share[i, 0] == pytest.approx(volume[i] / whole[block[i], block[i]] + (beta * v / whole[block[i], other])[near].sum(), rel=1e-12)


def test_factors_of_a_bond_are_the_same_at_both_ends():
    random, n = np.random.default_rng(4), 60
    x = random.uniform(0, 2, (n, 2))
    bonds, counts = find_bonds(x, np.arange(n), n, 0.8)
    points, slots = PointArrays(x, x, np.ones(n), np.zeros(n, np.uint8), np.zeros(n, np.uint8)), np.arange(n, dtype=np.int32)
    scale = random.uniform(1.0, 2.0, (n, 2))
    by_energy, by_volume = np.zeros(len(bonds.neighbour)), np.zeros(len(bonds.neighbour))
    surface.energy_factors(bonds, points, None, slots, scale, by_energy)
    surface.volume_factors(bonds, slots, scale[:, :1].copy(), by_volume)
    found = {}
    for i in range(n):
        for k in range(bonds.row_start[i], bonds.row_start[i] + counts[i]):
            j = int(bonds.neighbour[k])
            found[i, j] = by_energy[k], by_volume[k]
            direction, mean = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i]), 0.5 * (scale[i] + scale[j])
            assert by_energy[k] == pytest.approx(1 / np.linalg.norm(direction / mean), rel=1e-12)
            assert by_volume[k] == pytest.approx(1 / mean[0], rel=1e-12)
    assert len(found) > 100 and all(found[i, j] == found[j, i] for i, j in found)
