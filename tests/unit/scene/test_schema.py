from pathlib import Path

import pytest
from pydantic import ValidationError

from pdhpc.scene.read import parse_scene, read_scene, scene_from_dict
from pdhpc.scene.schema import COMPONENTS, SceneError, multiples
from pdhpc.study.verify.fracture import GROWING_CRACK

HERE = Path(__file__).resolve().parent
SCENES = sorted(HERE.glob("everything_*.toml")) + sorted((HERE.parents[2] / "runs").glob("*.toml"))


def test_defaults_and_derived_values():
    scene = parse_scene(GROWING_CRACK, "here.toml")
    assert scene.dim == 2 and scene.thickness == 1.0 and scene.source == "here.toml" and scene.time.safety == 0.9
    assert str(scene.error("a.b", 3, "four")) == "here.toml: a.b = 3; allowed is four" and isinstance(scene.error("a", 1, "b"), SceneError)
    assert str(scene.error("a.b", '"top", which selects no particle', "one")) == 'here.toml: a.b = "top", which selects no particle; allowed is one'


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_scene_is_rebuilt_from_what_it_resolved_to(path):
    scene = read_scene(path)
    again = scene_from_dict(scene.resolved(), "run.json")
    assert again.resolved() == scene.resolved()
    assert again.output_times() == scene.output_times() and again.history_times() == scene.history_times() and again.thickness == scene.thickness


def test_resolved_fills_in_what_is_not_given():
    data = parse_scene(GROWING_CRACK, "a", ["output={pictures=false}"]).resolved()
    assert data["output"]["frames"] == 20 and data["particles"]["thickness"] == 1.0 and data["material"][0]["poissons_ratio"] == 1 / 3


def test_scenes_do_not_change_after_validation():
    scene = parse_scene(GROWING_CRACK, "a")
    with pytest.raises(ValidationError):
        scene.title = "other"
    with pytest.raises(ValidationError):
        scene.particles.spacing = 2.0


@pytest.mark.parametrize("override, times", [
    ("output.frames=4", [5e-6, 10e-6, 15e-6, 20e-6]), ("output={times=[1e-6, 2e-6]}", [1e-6, 2e-6]), ("output.fields=[\"damage\"]", [10e-6, 20e-6]),
    ("output={every=9e-6}", [9e-6, 18e-6]),
])
def test_output_times(override, times):
    assert parse_scene(GROWING_CRACK, "a", [override]).output_times() == pytest.approx(times)


def test_intervals_reach_the_end():
    assert multiples(0.1, 0.3) == pytest.approx([0.1, 0.2, 0.3])
    assert len(parse_scene(GROWING_CRACK, "a").history_times()) == 20


def test_components_of_tensors_come_in_both_dimensions():
    assert COMPONENTS[2]["tensor"] == ["_xx", "_yy", "_xy"] and len(COMPONENTS[3]["tensor"]) == 6
