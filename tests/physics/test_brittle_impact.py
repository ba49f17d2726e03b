"""The scene runs/brittle_impact.toml on a smaller disc of three layers."""
from pdhpc.study.verify.case import CASES
from pdhpc.study.verify.shipped import SMALL_DISC, run_small


def test_the_sphere_grinds_the_disc():
    """More than half of the particles are damaged, the energy that the held sphere puts in is all accounted for, and debris leaves on the far side."""
    for check in CASES["brittle_impact"].function():
        assert check.passed, check


def test_what_is_left_is_counted(tmp_path):
    record = run_small("brittle_impact.toml", [*SMALL_DISC, "time.end=20e-6"], tmp_path / "out")
    assert record["broken_bonds"] > 10_000 and record["energies"]["external_work"] > 0.05
    assert record["fragments"]["dust"] > 0.1 and record["impactors"][0]["velocity"] == [0.0, 0.0, -100.0]
