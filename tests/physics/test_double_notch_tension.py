"""The scene runs/double_notch_tension.toml at twice the spacing."""
import csv
import math
from pathlib import Path

import pytest

from pdhpc.simulation import Simulation

SCENE = Path(__file__).resolve().parents[2] / "runs" / "double_notch_tension.toml"
COARSE = ["particles.spacing=1.0e-3", "particles.horizon=3.0e-3", "static.steps=12", "output.frames=12", "output.pictures=false"]


def peak_by_fracture_mechanics(youngs_modulus=30e9, energy_release_rate=50.0, notch=12e-3, half_width=30e-3, thickness=1e-3):
    """Return the load, N, at which K_I = s sqrt(pi a) F(a/b) is sqrt(E G) (Tada, Paris & Irwin, double-edge notched strip)."""
    q = notch / half_width
    shape = (1.122 - 0.561 * q - 0.205 * q**2 + 0.471 * q**3 + 0.190 * q**4) / math.sqrt(1 - q)
    return math.sqrt(youngs_modulus * energy_release_rate) / (shape * math.sqrt(math.pi * notch)) * 2 * half_width * thickness


def test_the_load_rises_straight_and_drops_to_nothing(tmp_path):
    """The peak lies above that of fracture mechanics, here with a horizon of a quarter of the notch's depth, by no more than a half."""
    record = Simulation.from_file(SCENE, COARSE).run(tmp_path / "out", quiet=True)
    with open(tmp_path / "out" / "history.csv") as file:
        rows = [{name.split(" [")[0]: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    load, pull = [row["grip.reaction_y"] for row in rows], [row["end.displacement_y"] for row in rows]
    peak = max(load)
    whole = [row for row in rows[1:] if row["broken_bonds"] == 0]
    assert len(whole) > 5 and all(row["grip.reaction_y"] == pytest.approx(load[1] / pull[1] * row["end.displacement_y"], rel=1e-6) for row in whole)
    assert 1.0 < peak / peak_by_fracture_mechanics() < 1.5 and peak_by_fracture_mechanics() == pytest.approx(326, abs=1)
    assert abs(load[-1]) < 1e-3 * peak and rows[-1]["broken_bonds"] > 500 and record["balance_error_relative"] < 1e-6
