from pdhpc.scene import vocabulary
from pdhpc.scene.loads import TractionLoad
from pdhpc.scene.schema import Particles, Scene
from pdhpc.scene.shapes import BoxShape


def test_locations_lead_to_places():
    assert vocabulary.locate(()).tables == [Scene]
    assert vocabulary.locate(("particles",)).tables == [Particles]
    face = vocabulary.locate(("load", 0, "traction", "face"))
    assert face.path == ("load", 0, "face") and face.field is TractionLoad.model_fields["face"]
    assert vocabulary.locate(("load", 0, "traction")).tables == [TractionLoad]


def test_a_key_with_the_name_of_a_tag_is_no_tag():
    assert vocabulary.locate(("body", 0, "box", "box")).path == ("body", 0, "box")


def test_locations_inside_nested_lists():
    place = vocabulary.locate(("body", 3, "disk", "hole", 1, "box", "lower", 0))
    assert place.path == ("body", 3, "hole", 1, "lower", 0)
    assert vocabulary.locate(("body", 3, "disk", "hole", 1, "box")).tables == [BoxShape]
    assert vocabulary.locate(("body", 3, "disk", "hole")).is_list
    assert vocabulary.locate(("crack", 0, "polyline", "points", 1, 0)).path == ("crack", 0, "points", 1, 0)


def test_unions_of_tables_and_their_tags():
    tables = vocabulary.locate(("load", 2, "gravity", "time")).tables
    assert [vocabulary.tag(model) for model in tables] == [("function", each) for each in ("constant", "ramp", "sine", "table")]
    assert vocabulary.tag(Particles) == (None, None)
    assert vocabulary.keys(tables)[:3] == ["function", "start", "end"]


def test_homes_of_keys():
    assert vocabulary.homes("horizon") == ["[particles]", "[[body]]"]
    assert vocabulary.homes("dimension") == ["the top level, above the first section"]
    assert vocabulary.homes("nonsense") == []


def test_choices_of_a_key():
    assert vocabulary.choices(Scene.model_fields["dimension"].annotation) == ['"plane_stress"', '"plane_strain"', '"3d"']
    assert vocabulary.choices(Particles.model_fields["spacing"].annotation) == []
