"""The shipped scene of a crack that runs through elements, at twice the spacing: what its head says, and what particles everywhere say."""
import csv
from pathlib import Path

import pytest

from pdhpc.simulation import Simulation

SCENE = Path(__file__).resolve().parents[2] / "runs" / "precracked_plate_gfem.toml"
COARSE = ["particles.spacing=0.5e-3", "particles.horizon=1.5075e-3", "output.pictures=false"]


def run(directory, *overrides):
    """Return (run.json, [{column: value}] of history.csv)."""
    record = Simulation.from_file(SCENE, [*COARSE, *overrides]).run(directory, quiet=True)
    with open(Path(directory) / "history.csv") as file:
        return record, [{name.split(" [")[0]: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


def test_patches_go_with_the_crack(tmp_path):
    record, rows = run(tmp_path / "coupled")
    full, full_rows = run(tmp_path / "full", "model=particles")
    shares = [row["active_share"] for row in rows]
    assert shares == sorted(shares) and 0.08 < shares[0] < 0.1 and shares[0] + 0.05 < shares[-1] < 0.25, shares
    tips = {"coupled": record["tips"]["crack"], "full": full["tips"]["crack"]}
    assert tips["coupled"]["position"][0] > 0.05 and tips["coupled"]["largest_speed"] < 3080
    assert tips["coupled"]["position"][0] == pytest.approx(tips["full"]["position"][0], abs=4 * 0.5e-3)
    assert record["broken_bonds"] == pytest.approx(full["broken_bonds"], rel=0.1)
    assert rows[-1]["external_work"] == pytest.approx(full_rows[-1]["external_work"], rel=0.05)
    assert abs(rows[-1]["balance_error"]) < 0.04 * rows[-1]["external_work"]
    assert record["coupling"]["ghost_force"] < 0.05 and not record["warnings"]
