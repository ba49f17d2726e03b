import pytest

from pdhpc.scene.mesh_rules import unused
from pdhpc.scene.read import parse_scene, scene_from_dict
from pdhpc.scene.schema import SceneError
from tests.unit.scene.test_rules import BASE, LOAD, REGION

STILL = BASE.replace("end = 1.0\n", 'end = 1.0\nmethod = "newton"\n') + REGION + LOAD.replace('"free"', "0.0")


@pytest.mark.parametrize("overrides, words", [
    (["time.dt=0.1"], ["time.dt = 0.1", '"auto"', "static.steps"]),
    (['fine={shape="disk", center=[5.0, 2.5], radius=1.0, step_ratio=2}'], ["fine = a table", 'none with time.method = "newton"']),
    (["initial=[{velocity=[1.0, 0.0]}]"], ["initial = 1 of them", "at rest"]),
    (["load.l.type=velocity"], ["load 'l': type = \"velocity\"", '"displacement" or a force']),
    (["output={times=[0.5, 1.0]}"], ["static.steps = nothing beside output.times"]),
    (["static.steps=0"], ["static.steps = 0", "whole number"]),
    (["static.tolerance=1.0"], ["static.tolerance = 1.0", "below 1"]),
    (["static.breaking=some"], ['static.breaking = "some"', '"all", "most_strained"']),
    (["static.breaking=most_strained", "material.m.energy_release_rate=1.0", "material.m.failure=energy"], ["static.breaking", 'failure = "energy" of material', '"all"']),
    (["static.breaking=most_strained", "material.m.energy_release_rate=1.0", "material.m.stretch_softening=0.25"], ["static.breaking", "stretch_softening = 0.25"]),
    (["static.breaking=most_strained", "material.m.energy_release_rate=1.0", "material.m.weibull_modulus=9"], ["static.breaking", "weibull_modulus = 9.0"]),
    (['contact={}'], ['contact = a table with time.method = "newton"', 'brought to rest', '"single"']),
    (["static.tolerence=0.1"], ["static.tolerence is an unknown key", 'did you mean "tolerance"?']),
    (["time.method=relaxations"], ['time.method = "relaxations"', 'did you mean "relaxation"?']),
    (["model=fem", "mesh={cell_size=0.5}"], ['time.method = "newton" with model = "fem"']),
    (["model=gfem", "mesh={cell_size=2.5}", "particles.kinematics=linear"], ['time.method = "newton" with model = "gfem"']),
])
def test_each_rule_in_one_sentence(overrides, words):
    with pytest.raises(SceneError) as caught:
        parse_scene(STILL, "f", overrides)
    found = str(caught.value)
    assert "; allowed i" in found and "\n" not in found and all(word in found for word in words), found


@pytest.mark.parametrize("overrides, steps", [
    ([], 20), (["output.frames=7"], 7), (["output.every=0.3"], 4), (["output.every=0.25"], 4), (["output.frames=7", "static.steps=3"], 3),
])
def test_load_steps_follow_frames_unless_they_are_given(overrides, steps):
    scene = parse_scene(STILL, "f", overrides)
    assert scene.load_steps == steps and scene.history_times() == [pytest.approx((number + 1) / steps) for number in range(steps)]


def test_what_is_resolved_is_a_scene_again():
    scene = parse_scene(STILL, "f")
    resolved = scene.resolved()
    assert resolved["static"] == {"steps": 20, "tolerance": 1e-6, "iterations": 30, "breaking": "all", "equilibria": 500}
    assert scene_from_dict(resolved, "f").resolved() == resolved
    assert "static" not in parse_scene(BASE, "f").resolved()


@pytest.mark.parametrize("text, overrides, words", [
    (STILL, [], []), (STILL, ["time.safety=0.5"], ["time.safety is not used"]),
    (STILL, ["time.method=single", "static.steps=3"], ["[static] is not used"]),
])
def test_what_is_left_unused(text, overrides, words):
    found = unused(parse_scene(text, "f", overrides))
    assert len(found) == len(words) and all(word in sentence for word, sentence in zip(words, found)), found
