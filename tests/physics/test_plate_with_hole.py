"""The scene runs/plate_with_hole.toml as it stands, 2,242 particles, and strained evenly."""
import csv
from pathlib import Path

import numpy as np
import pytest

from pdhpc.simulation import Simulation
from pdhpc.study.verify.hole import concentration

SCENE = Path(__file__).resolve().parents[2] / "runs" / "plate_with_hole.toml"
PULL, E = 10e6, 70e9


def test_the_edge_of_the_hole_takes_what_a_horizon_leaves_of_three(tmp_path):
    """As a structured mesh of the same horizon over radius does, 2.50, of which coarser cells at the edge, whose centres lie farther in, take a twentieth."""
    record = Simulation.from_file(SCENE, ["output.pictures=false"]).run(tmp_path / "out", quiet=True)
    with open(tmp_path / "out" / "history.csv") as file:
        row = {name.split(" [")[0]: float(value) for name, value in list(csv.DictReader(file))[-1].items()}
    structured = concentration(0.5)
    assert structured == pytest.approx(2.506, abs=0.01)
    assert row["across.strain_xx"] * E / PULL == pytest.approx(0.95 * structured, rel=0.03)
    assert row["in_line.strain_yy"] < -0.6 * PULL / E, "pressed in line with the pull, by less than the pull (Kirsch)"
    assert row["grip.reaction_x"] == pytest.approx(-PULL * 0.08 * 1e-3, rel=2e-3), "traction times width times thickness"
    assert row["residual"] < 1e-6 and record["broken_bonds"] == 0 and record["particles"] == 2242


def test_the_strain_is_exact_where_the_strip_is_stretched_evenly():
    """At the edges of the hole and of the strip too, whatever the sizes of the cells."""
    simulation = Simulation.from_file(SCENE)
    subdomain, stepper = simulation.problem.subdomain, simulation.stepper
    gradient, places = np.array([[2e-3, 1e-3], [-3e-3, 5e-4]]), subdomain.places()
    subdomain.particles.put(subdomain.particles.displacement, places @ gradient.T)
    subdomain.particles.place()
    assert np.abs(stepper.view.field("strain") - 0.5 * (gradient + gradient.T)).max() < 1e-12
    edge = np.abs(np.linalg.norm(places, axis=1) - 0.01) < 1e-3
    assert edge.sum() > 40
