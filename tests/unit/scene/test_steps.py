import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.scene.steps import choose_step
from pdhpc.study.verify.case import plate


def test_steps():
    scene = parse_scene(plate(), "t")
    dt, steps, warnings = choose_step(scene, 0.1)
    assert steps == 12 and dt == pytest.approx(1 / 12) and not warnings  # 1 / (0.9 x 0.1) = 11.1
    assert choose_step(parse_scene(plate(), "t", ["time.dt=0.08"]), 0.1)[:2] == (0.08, 13)
    assert choose_step(parse_scene(plate(), "t", ["time.dt=0.25"]), 0.3)[:2] == (0.25, 4)
    with pytest.raises(SceneError, match="time.dt = 0.2 s; allowed is .*0.1 s"):
        choose_step(parse_scene(plate(), "t", ["time.dt=0.2"]), 0.1)
    assert "above the critical step" in choose_step(parse_scene(plate(), "t", ["time.dt=0.2", "time.allow_unstable=true"]), 0.1)[2][0]


def test_a_share_of_the_critical_step_may_be_the_most():
    scene = parse_scene(plate(), "t", ["time.dt=0.09"])
    assert choose_step(scene, 0.1)[0] == 0.09
    with pytest.raises(SceneError, match="time.dt = 0.09 s; allowed is .* up to 0.8 of the critical 0.1 s, 0.08 s"):
        choose_step(scene, 0.1, 0.8)
