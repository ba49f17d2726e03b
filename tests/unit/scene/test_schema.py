import pytest

from pdhpc.scene.read import parse_scene, scene_from_dict
from pdhpc.scene.schema import multiples
from pdhpc.study.verify.fracture import GROWING_CRACK


def test_defaults_and_derived_values():
    scene = parse_scene(GROWING_CRACK, "here.toml")
    assert scene.dim == 2 and scene.thickness == 1.0 and scene.source == "here.toml" and scene.time.safety == 0.9
    assert str(scene.error("a.b", 3, "four")) == "here.toml: a.b = 3; allowed is four"


def test_a_scene_is_rebuilt_from_what_it_resolved_to():
    scene = parse_scene(GROWING_CRACK, "a")
    assert scene_from_dict(scene.resolved(), "b").resolved() == scene.resolved()


@pytest.mark.parametrize("override, times", [
    ("output.frames=4", [5e-6, 10e-6, 15e-6, 20e-6]), ("output={times=[1e-6, 2e-6]}", [1e-6, 2e-6]), ("output.fields=[\"damage\"]", [10e-6, 20e-6]),
])
def test_output_times(override, times):
    assert parse_scene(GROWING_CRACK, "a", [override]).output_times() == pytest.approx(times)


def test_intervals_reach_the_end():
    assert multiples(0.1, 0.3) == pytest.approx([0.1, 0.2, 0.3])
    assert len(parse_scene(GROWING_CRACK, "a").history_times()) == 20
