"""Explain a scene: every key with its value, origin, unit, meaning and source; and the JSON schema, both from the models of schema.py."""
from typing import NamedTuple

from pdhpc.scene.fields import Table, printable
from pdhpc.scene.schema import Scene


class Row(NamedTuple):
    """One key of a scene."""

    key: str
    value: str
    origin: str
    unit: str
    meaning: str
    source: str


def explain(scene):
    """Return a Row for every key of the scene, given and default, in the order of the schema."""
    return list(_rows(scene, scene.resolved(), ""))


def _rows(table, resolved, prefix):
    """Yield the Rows of a table; `resolved` holds its values with defaults filled in."""
    for name, field in type(table).model_fields.items():
        value, path = getattr(table, name), f"{prefix}{name}"
        if isinstance(value, Table):
            yield from _rows(value, resolved[name], f"{path}.")
        elif isinstance(value, list) and value and isinstance(value[0], Table):
            for number, (each, below) in enumerate(zip(value, resolved[name])):
                yield from _rows(each, below, f"{path}.{getattr(each, 'name', None) or number}.")
        else:
            extra = field.json_schema_extra
            origin = "given" if name in table.model_fields_set and value is not None else "default"
            yield Row(path, _write(resolved.get(name)), origin, extra["unit"], field.description, extra["source"])


def _write(value):
    """Return a value as it stands in a scene, a text without quotes; "-" for none."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(_write(each) for each in value)}]"
    return printable(str(value))


def json_schema():
    """Return the JSON schema of scenes (draft 2020-12), for editors."""
    schema = _without_null(Scene.model_json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _without_null(node):
    """Return a JSON schema without the null that stands for an absent key, which TOML does not have."""
    if isinstance(node, list):
        return [_without_null(each) for each in node]
    if not isinstance(node, dict):
        return node
    node = {name: _without_null(each) for name, each in node.items() if not (name == "default" and each is None)}
    offers = [each for each in node.get("anyOf", []) if each != {"type": "null"}]
    if len(offers) == 1 and len(offers) < len(node["anyOf"]):
        del node["anyOf"]
        return {**offers[0], **node}
    return node
