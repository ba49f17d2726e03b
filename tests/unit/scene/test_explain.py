"""Explaining: every key of the language, from the same place as the JSON schema."""
import json
import re
import typing
from pathlib import Path
from typing import Any

import pytest

from pdhpc.scene import vocabulary
from pdhpc.scene.explain import explain, explain_all, json_schema
from pdhpc.scene.read import parse_scene, read_scene
from pdhpc.scene.shapes import BandFine, BoxFine, SphereFine
from pdhpc.scene.schema import Scene
from pdhpc.study.verify.fracture import GROWING_CRACK

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib

HERE = Path(__file__).resolve().parent
RUNS = HERE.parents[2] / "runs"
EVERYTHING = [HERE / f"everything_{name}.toml" for name in ("2d", "3d", "fem", "gfem", "fragments", "files", "contact", "static")]


def all_models(model=Scene, seen=None):
    """Return every Table that a scene can hold."""
    seen = set() if seen is None else seen
    if model not in seen:
        seen.add(model)
        for field in model.model_fields.values():
            for member in vocabulary.members(field.annotation):
                all_models(member, seen)
    return seen


def tables_of(table):
    """Yield a table of a scene and all tables inside it."""
    yield table
    for name in type(table).model_fields:
        value = getattr(table, name)
        for each in value if isinstance(value, list) else [value]:
            if hasattr(type(each), "model_fields"):
                yield from tables_of(each)


def leaves(value, prefix=""):
    """Yield the keys of all plain values of a resolved scene, entries of lists by name or index."""
    for name, each in value.items():
        if isinstance(each, dict):
            yield from leaves(each, f"{prefix}{name}.")
        elif isinstance(each, list) and each and isinstance(each[0], dict):
            for number, table in enumerate(each):
                yield from leaves(table, f"{prefix}{name}.{table.get('name') or number}.")
        else:
            yield f"{prefix}{name}"


def test_the_scenes_hold_every_table_of_the_language():
    held = {type(table) for path in EVERYTHING for table in tables_of(read_scene(path))}
    assert held == all_models() - {BoxFine, SphereFine, BandFine} and len(held) > 30, "a scene has one fine region, of one shape"


@pytest.mark.parametrize("path", EVERYTHING, ids=lambda path: path.stem)
def test_every_key_of_every_table_is_explained(path):
    scene = read_scene(path)
    rows = [row for row in explain(scene) if row.origin != "absent"]
    found = [row.key for row in rows]
    assert len(found) == len(set(found)) and set(leaves(scene.resolved())) <= set(found)
    plain = sum(1 for table in tables_of(scene) for name in type(table).model_fields if not holds_tables(getattr(table, name)))
    assert len(found) == plain
    assert all(row.meaning and row.origin in ("given", "default") for row in rows)


def test_keys_of_absent_tables_are_there_too_and_marked_so():
    rows = {row.key: row for row in explain(read_scene(HERE / "everything_2d.toml"))}
    assert rows["contact.distance"][1:4] == ("auto", "absent", "m") and rows["static.tolerance"].origin == "absent" and rows["time.end"].origin == "given"
    assert rows["impactor[].shape"].value == "-" and "sphere: rigid sphere, 3D; cylinder: " in rows["impactor[].shape"].meaning
    assert not [key for key in rows if key.startswith("particles[") or key.startswith("load[]")], "those that are there stand under their names"


def test_all_keys_of_the_language_without_a_scene():
    found = {row.key: row for row in explain_all()}
    names = {name for model in all_models() for name, field in model.model_fields.items() if not vocabulary.members(field.annotation)}
    assert {re.sub(r"\[\]", "", key).split(".")[-1] for key in found} == names and len(found) > 150
    assert found["particles.spacing"].origin == "required" and found["particles.path"][1:3] == ("auto", "default")
    assert "load[].time.function" in found and "body[].hole[].radius" in found and all(row.meaning for row in found.values())


def holds_tables(value):
    each = value[0] if isinstance(value, list) and value else value
    return hasattr(type(each), "model_fields")


def is_number(annotation):
    """Whether numbers stand at a key: floats, ints, or Any (a number or a word)."""
    return annotation in (float, int, Any) or any(is_number(each) for each in typing.get_args(annotation) if typing.get_origin(annotation) is not typing.Literal)


def test_every_key_has_a_meaning_and_every_number_a_unit():
    numbers = 0
    for model in all_models():
        for name, field in model.model_fields.items():
            assert field.description and set(field.json_schema_extra) == {"unit", "source"}, f"{model.__name__}.{name}"
            if is_number(field.annotation) and not vocabulary.members(field.annotation):
                numbers += 1
                assert field.json_schema_extra["unit"], f"{model.__name__}.{name} has no unit"
    assert numbers > 40


def test_given_and_default_are_told_apart():
    rows = {row.key: row for row in explain(parse_scene(GROWING_CRACK, "a"))}
    assert rows["particles.horizon"].origin == "given" and rows["particles.horizon"].unit == "m"
    assert rows["particles.influence"].origin == "default" and "omega" in rows["particles.influence"].source
    assert rows["material.glass.energy_release_rate"].value == "204.0" and rows["load.0.time.function"].value == "constant"
    assert rows["time.dt"].value == "auto" and "rho" in rows["time.dt"].source


def test_the_scenes_use_every_key_of_the_language():
    given = {name for path in EVERYTHING for table in tables_of(read_scene(path)) for name in table.model_fields_set}
    assert {name for model in all_models() for name in model.model_fields} - given == {"frames"}, "it excludes every and times, which the scenes use"


def test_defaults_that_depend_on_other_keys_are_filled_in():
    rows = {row.key: row for row in explain(read_scene(EVERYTHING[0]))}
    assert rows["material.steel.poissons_ratio"][1:3] == ("0.25", "default"), "pmb fixes it"
    rows = {row.key: row for row in explain(read_scene(EVERYTHING[1]))}
    assert rows["material.stone.poissons_ratio"][1:3] == ("-", "default") and rows["material.brass.poissons_ratio"][1:3] == ("0.35", "given"), "lps has none"
    assert rows["material.stone.bulk_modulus"][1:3] == ("40000000000.0", "given") and rows["particles.path"][1:3] == ("lattice", "given")
    assert rows["tip.tip.direction"][1:3] == ("[1.0, 0.0, 0.0]", "default")
    assert rows["output.every"][1:3] == ("0.3", "given") and rows["output.frames"][1:3] == ("-", "default") and rows["particles.thickness"].value == "-"
    assert rows["initial.0.origin"].value == "[0.0, 0.0, 0.0]"


def test_json_schema_names_units_and_meanings():
    schema = json_schema()
    spacing = schema["$defs"]["Particles"]["properties"]["spacing"]
    assert spacing["unit"] == "m" and "distance" in spacing["description"] and spacing["exclusiveMinimum"] == 0
    assert schema["additionalProperties"] is False and '"null"' not in json.dumps(schema)


def fits(value, schema, root):
    """Whether a value fits a JSON schema: the keywords that the scene's schema uses."""
    if "$ref" in schema:
        return fits(value, root["$defs"][schema["$ref"].rsplit("/", 1)[1]], root)
    known = {"type", "properties", "required", "additionalProperties", "items", "minItems", "enum", "const", "anyOf", "oneOf", "pattern", "maxLength",
             "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "allOf",
             "title", "description", "default", "unit", "source", "discriminator", "$defs", "$schema"}  # the last line only comments
    assert set(schema) <= known, set(schema) - known
    types = {"object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float), "integer": int}
    if "type" in schema and (not isinstance(value, types[schema["type"]]) or (isinstance(value, bool) and schema["type"] != "boolean")):
        return False
    if "const" in schema and value != schema["const"] or "enum" in schema and value not in schema["enum"]:
        return False
    if "anyOf" in schema and not any(fits(value, each, root) for each in schema["anyOf"]):
        return False
    if "oneOf" in schema and sum(fits(value, each, root) for each in schema["oneOf"]) != 1:
        return False
    if not all(fits(value, each, root) for each in schema.get("allOf", [])):
        return False
    if isinstance(value, dict) and "properties" in schema:
        inner = schema["properties"]
        return set(schema.get("required", [])) <= set(value) <= set(inner) and all(fits(value[name], inner[name], root) for name in value)
    if isinstance(value, list):
        return len(value) >= schema.get("minItems", 0) and all(fits(each, schema.get("items", {}), root) for each in value)
    if isinstance(value, str):
        return len(value) <= schema.get("maxLength", 10**9) and bool(re.search(schema.get("pattern", ""), value))
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (schema.get("minimum", value) <= value <= schema.get("maximum", value)
                and schema.get("exclusiveMinimum", value - 1) < value < schema.get("exclusiveMaximum", value + 1))
    return True


@pytest.mark.parametrize("path", EVERYTHING + sorted(RUNS.glob("*.toml")), ids=lambda path: path.stem)
def test_scenes_fit_the_json_schema(path):
    schema = json_schema()
    assert fits(tomllib.loads(path.read_text()), schema, schema)
    assert fits(read_scene(path).resolved(), schema, schema)


@pytest.mark.parametrize("old, new", [
    ("horizon = 1.5", "horizn = 1.5"), ("density = 2500", "density = 0"), ("density = 2500", 'density = "a"'), ('shape = "disk"', 'shape = "dsk"'), ("safety = 0.8", "safety = 1.1"),
    ("value = [1.0, \"free\"]", "value = [1.0, \"fre\"]"), ('name = "stone"', 'name = "1"'), ("end = 1.0\n", ""), ('dt = "auto"', "dt = -1.0"), ("pictures = false", "pictures = 0"),
])
def test_broken_scenes_do_not_fit_the_json_schema(old, new):
    text = EVERYTHING[0].read_text()
    assert old in text
    assert not fits(tomllib.loads(text.replace(old, new, 1)), json_schema(), json_schema())
