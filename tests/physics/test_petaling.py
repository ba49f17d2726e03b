"""The scene runs/petaling.toml on a smaller plate at a coarser spacing."""
from pathlib import Path

import h5py
import numpy as np

from pdhpc.simulation import Simulation
from pdhpc.study.verify.petaling import COARSE, SCENE, rays


def test_rays_are_counted_where_they_cross_a_circle():
    """Four bands along the axes, each three particles wide, of a plane of 41 x 41; one of them does not reach the circle of radius 12."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-20.0, 21.0), np.arange(-20.0, 21.0)))
    damage = 1.0 * (((np.abs(x) <= 1) | (np.abs(y) <= 1)) & (x < 8))
    assert len(rays(np.stack([x, y], axis=1), damage, 12.0, 1.0)) == 3
    assert sorted(round(angle) for angle in rays(np.stack([x, y], axis=1), damage, 6.0, 1.0)) == [-90, 0, 90, 180]


def test_cracks_like_rays_of_a_star_and_little_else(tmp_path):
    """Eight of them; the ball has dished the middle, nothing happens far from it, and the energy it puts in is all accounted for."""
    record = Simulation.from_file(SCENE, COARSE).run(tmp_path / "out", quiet=True)
    with h5py.File(tmp_path / "out" / "fields.h5") as file:
        last = file["frames"][sorted(file["frames"])[-1]]
        damage, u, x = last["damage"][:], last["displacement"][:], file["points/position"][:]
    assert 0.05 < (damage > 0.05).mean() < 0.1 and record["broken_bonds"] > 10_000
    assert record["balance_error_relative"] < 0.005
    assert len(rays(x[:, :2], damage, 8e-3, 0.75e-3)) == 8
    middle, outside = np.linalg.norm(x[:, :2], axis=1) < 3e-3, np.abs(x[:, :2]).max(axis=1) > 25e-3
    assert np.median(u[middle, 2]) < -5e-3 and not damage[outside].any()
