from mpi4py import MPI

from pdhpc.scene.read import parse_scene
from pdhpc.study.scaling import COLUMNS, Study
from pdhpc.study.scaling_point import measure
from pdhpc.study.verify.case import plate


def test_a_row_has_every_column_and_adds_up(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = Study(scene="x", kind="strong", ranks=[1], steps=5, warm_up=2)
    row = measure(study, parse_scene(plate((12, 10), 2.0), "plate"), MPI.COMM_SELF)
    assert set(COLUMNS) - set(row) == {"study", "kind", "commit", "repeat"}  # those the parent adds
    assert row["particles"] == 120 and row["steps"] == 5 and row["bond_imbalance"] == row["force_imbalance"] == 1.0
    phases = sum(row[f"{name}_mean"] for name in ("force", "exchange", "wait", "integrate", "contact"))
    assert 0.2 * row["seconds"] < phases <= row["seconds"]  # steps of 20 microseconds, of which the drive loop is a part
    assert list(tmp_path.iterdir()) == []  # the frame that was timed is gone


def test_a_scene_with_two_regions_is_measured_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fine = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 3.0\nstep_ratio = 4\n'
    row = measure(Study(scene="x", kind="strong", ranks=[1], steps=5, warm_up=2), parse_scene(plate((24, 16), extra=fine), "plate"), MPI.COMM_SELF)
    assert row["particles"] == 24 * 16 and row["bond_imbalance"] == 1.0 and row["bonds"] > 0
