"""The scene runs/brittle_impact.toml on a smaller disc of three layers."""
from pathlib import Path

import h5py
import numpy as np
import pytest

from pdhpc.simulation import Simulation

SCENE = Path(__file__).resolve().parents[2] / "runs" / "brittle_impact.toml"
COARSE = ["particles.spacing=0.8333333333333333e-3", "particles.horizon=2.5e-3", "body.disc.radius=15e-3", "time.end=40e-6", "output.frames=2", "output.pictures=false"]


def test_the_sphere_grinds_the_disc(tmp_path):
    """More than half of the particles are damaged, the energy that the held sphere puts in is all accounted for, and debris leaves on the far side."""
    record = Simulation.from_file(SCENE, COARSE).run(tmp_path / "out", quiet=True)
    with h5py.File(tmp_path / "out" / "fields.h5") as file:
        last = file["frames"][sorted(file["frames"])[-1]]
        damage, u, z = last["damage"][:], last["displacement"][:], file["points/position"][:, 2]
    assert (damage > 0.05).mean() > 0.5 and record["broken_bonds"] > 10_000
    assert record["balance_error_relative"] < 0.02 and record["energies"]["external_work"] > 0.1
    assert (z + u[:, 2]).min() < -1e-3, "below where the disc was, 0 to 2.5 mm"
    assert record["fragments"]["dust"] > 0.1 and record["energies"]["kinetic_energy"] == pytest.approx(record["energies"]["external_work"], rel=0.3)
    assert np.isfinite(u).all()
