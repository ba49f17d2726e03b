"""The scene runs/kalthoff_winkler.toml at twice the spacing."""
from pdhpc.simulation import Simulation
from pdhpc.study.verify.kalthoff import SCENE, judge

COARSE = ["particles.spacing=0.5e-3", "particles.horizon=1.5e-3", "region.struck.upper=[0.0015,0.02425]", "output.frames=1", "output.pictures=false"]


def test_cracks_leave_the_notches_at_the_angle_of_the_experiment(tmp_path):
    Simulation.from_file(SCENE, COARSE).run(tmp_path / "out", quiet=True)
    failures = [check for check in judge(tmp_path / "out") if not check.passed]
    assert not failures
