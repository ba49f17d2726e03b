import numpy as np
import pytest

from pdhpc.geometry.shapes import Disk
from pdhpc.mts.decomposition import Split, mass_share
from pdhpc.peridynamics.lattice_subdomain import make_stencil

POINTS = np.stack(np.meshgrid(np.arange(-12, 13) + 0.0, np.arange(-12, 13) + 0.0, indexing="ij"), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("radius", (3.5, 3.0))
def test_no_bond_crosses_the_overlap_and_the_ramp_runs_from_0_to_1(radius):
    for stencil in (None, make_stencil(2, radius)):
        split = Split(Disk((0.2, 0.1), 4.3), radius * (1 + 1e-9), 1.0, radius, False, stencil)
        coarse, fine = split.coarse.contains(POINTS), split.fine.contains(POINTS)
        only_coarse, only_fine = POINTS[coarse & ~fine], POINTS[fine & ~coarse]
        assert np.all(coarse | fine) and np.array_equal(split.overlap(POINTS), coarse & fine)
        assert np.linalg.norm(only_coarse[:, None] - only_fine[None], axis=2).min() > radius
        share = split.coarse_share(POINTS)
        assert np.all(share[fine & ~coarse] == 0) and np.all(share[coarse & ~fine] == 1) and np.all((share[coarse & fine] > 0) & (share[coarse & fine] < 1))
    assert (coarse & fine).sum() < Split(Disk((0.2, 0.1), 4.3), radius, 1.0, radius, False).overlap(POINTS).sum(), "a lattice needs fewer"


def test_shared_by_points_whoever_has_a_share_has_the_family():
    split = Split(Disk((0.0, 0.0), 2.5), 6.0, 1.0, 3.0, True)
    share, distance = split.coarse_share(POINTS), split.shape.distance(POINTS)
    assert np.all(distance[share > 0] > 3.0) and np.all(distance[share < 1] <= 6.0 - 3.0 + 1e-12)


def test_masses_follow_stiffness():
    assert mass_share(np.array([1.0, 0.0, 3.0, 0.0]), np.array([3.0, 2.0, 0.0, 0.0])) == pytest.approx([0.25, 1e-6, 1 - 1e-6, 0.5])
