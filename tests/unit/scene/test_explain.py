import typing

from pydantic import BaseModel

from pdhpc.scene.explain import _members, explain, json_schema, model_at, tags_at
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import Scene
from pdhpc.study.verify.fracture import GROWING_CRACK


def all_models(model, seen):
    """Every Table that a scene can hold."""
    if model in seen:
        return seen
    seen.add(model)
    for field in model.model_fields.values():
        for member in _members(field.annotation):
            all_models(member, seen)
    return seen


def test_every_key_of_every_table_has_a_meaning_and_numbers_have_units():
    models = all_models(Scene, set())
    assert len(models) > 30
    for model in models:
        for name, field in model.model_fields.items():
            assert field.description, f"{model.__name__}.{name}"
            assert set(field.json_schema_extra or {}) == {"unit", "source"} or isinstance(field.default, BaseModel) or _members(field.annotation), name


def test_given_and_default_are_told_apart():
    rows = {row.key: row for row in explain(parse_scene(GROWING_CRACK, "a"))}
    assert rows["particles.horizon"].origin == "given" and rows["particles.horizon"].unit == "m"
    assert rows["particles.influence"].origin == "default" and "omega" in rows["particles.influence"].source
    assert rows["material.glass.energy_release_rate"].value == "204.0" and rows["load.0.time.function"].value == "constant"
    assert rows["time.dt"].value == "auto" and "rho" in rows["time.dt"].source


def test_every_key_that_a_scene_holds_is_explained():
    scene = parse_scene(GROWING_CRACK, "a")
    keys = {row.key for row in explain(scene)}

    def leaves(value, prefix):
        for name, each in value.items():
            if isinstance(each, dict):
                yield from leaves(each, f"{prefix}{name}.")
            elif isinstance(each, list) and each and isinstance(each[0], dict):
                for number, table in enumerate(each):
                    yield from leaves(table, f"{prefix}{name}.{table.get('name') or number}.")
            else:
                yield f"{prefix}{name}"

    assert set(leaves(scene.resolved(), "")) <= keys


def test_json_schema_names_units_and_meanings():
    schema = json_schema()
    spacing = schema["$defs"]["Particles"]["properties"]["spacing"]
    assert spacing["unit"] == "m" and "distance" in spacing["description"]
    assert schema["additionalProperties"] is False


def test_locations_lead_to_models():
    assert "horizon" in model_at(("particles",)).model_fields
    assert "face" in model_at(("load", 0, "traction")).model_fields
    assert tags_at(("load", 2))[0] == "type" and "gravity" in tags_at(("load", 2))[1]
    assert tags_at(("load", 0, "gravity", "time")) == ("function", ["constant", "ramp", "sine", "table"])
    assert typing.get_args(Scene.model_fields["model"].annotation) == ("particles",)
