"""The scene runs/fragmenting_cylinder.toml, a fifth as long and coarser."""
from pathlib import Path

import h5py
import numpy as np

from pdhpc.simulation import Simulation
from pdhpc.study.verify.fragmentation import SHORT

SCENE = Path(__file__).resolve().parents[2] / "runs" / "fragmenting_cylinder.toml"


def test_the_cylinder_bursts_into_strips(tmp_path):
    """Fragments go through the whole wall, lie all around, and move apart; another seed breaks it elsewhere."""
    record = Simulation.from_file(SCENE, SHORT).run(tmp_path / "out", quiet=True)
    with h5py.File(tmp_path / "out" / "fields.h5") as file:
        last = file["frames"][sorted(file["frames"])[-1]]
        fragment, x, u = last["fragment"][:], file["points/position"][:], last["displacement"][:]
    names, counts = np.unique(fragment[fragment >= 0], return_counts=True)
    assert len(names) == record["fragments"]["count"] > 7 and counts.min() >= 10
    large = names[counts > 100]
    assert len(large) > 7
    for name in large:
        inside = fragment == name
        r = np.hypot(x[inside, 0], x[inside, 1])
        assert r.min() < 0.022 and r.max() > 0.023, "through the wall of 20 to 25 mm"
        middle = x[inside].mean(axis=0)
        assert u[inside].mean(axis=0)[:2] @ middle[:2] / np.hypot(*middle[:2]) > 0.003, "40 us at more than half of 200 m/s would be 4 mm and more"
    around = np.sort([np.arctan2(*x[fragment == name].mean(axis=0)[1::-1]) for name in large])
    assert np.diff(np.append(around, around[0] + 2 * np.pi)).max() < 1.6, "no quarter without one"
    other = Simulation.from_file(SCENE, [*SHORT, "material.steel.weibull_seed=2"]).run(quiet=True)
    assert other["fragments"]["heaviest"] != record["fragments"]["heaviest"] and other["fragments"]["count"] > 7
