import csv

import numpy as np
import pytest

from pdhpc.scene.schema import SceneError
from pdhpc.study.chart import METHODS, chart, report
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.mts import FINE

PULL = '[[initial]]\nregion = "all"\nvelocity_gradient = [[0.0, 0.0], [0.0, 1e-3]]\n'


def test_a_chart_of_a_small_plate(tmp_path):
    scene = tmp_path / "plate.toml"
    scene.write_text(plate((20, 14), kinematics="finite", extra=FINE.format(radius=3.0, m=2) + PULL))
    points = chart(scene, ["time.end=20.0"], [1, 2, 4], list(METHODS), tmp_path / "out")
    found = {(point.method, point.m): point for point in points}
    assert len(found) == 6 * 3 - 1 and found["single", 1].error == 0.0 and found["single", 1].cost == 1.0
    for method in ("polynomial", "exact", "subcycling", "micro"):
        assert found[method, 1].error < 1e-11
        assert 0 < found[method, 2].error < found[method, 4].error, method
    assert found["polynomial", 4].error < found["single", 4].error
    assert found["single", 4].cost == pytest.approx(0.25, rel=0.05) and found["polynomial", 4].cost < found["exact", 4].cost
    assert all(np.isfinite(point.error) and point.failure is None for point in points)
    with open(tmp_path / "out" / "chart.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(points) and float(rows[3]["error"]) == points[3].error
    assert report(points, tmp_path / "out").exists()


def test_a_scene_without_a_fine_region_is_refused(tmp_path):
    scene = tmp_path / "plate.toml"
    scene.write_text(plate((8, 8)))
    with pytest.raises(SceneError, match="fine = nothing"):
        chart(scene, [], [1, 2], ["single"], tmp_path)
