"""Explain a scene: every key with its value, origin, unit, meaning and source; and the JSON schema, both from the models of schema.py."""
from typing import NamedTuple

from pdhpc.scene.fields import Table, printable
from pdhpc.scene.schema import Scene
from pdhpc.scene.vocabulary import Place, keys, members, tag


class Row(NamedTuple):
    """One key of a scene."""

    key: str
    value: str
    origin: str
    unit: str
    meaning: str
    source: str


def explain(scene):
    """Return a Row for every key of the scene, given and default, in the order of the schema; after a table that is absent its keys, with that as origin."""
    rows = list(_rows(scene, scene.resolved(), ""))
    for name, field in Scene.model_fields.items():
        if members(field.annotation) and not getattr(scene, name):
            at = next(number for number, row in enumerate(rows) if row.key == name)
            rows[at + 1 : at + 1] = [row._replace(origin="absent") for row in _keys([Scene], "") if row.key.startswith((f"{name}.", f"{name}[]."))]
    return rows


def explain_all():
    """Return a Row for every key that a scene can hold: its default, and whether it is required; entries of lists as name[]."""
    return list(_keys([Scene], ""))


def _keys(models, prefix):
    """Yield a Row for each key of the Table models of which one stands at a place."""
    for name in keys(models):
        fields = [model.model_fields[name] for model in models if name in model.model_fields]
        below = members(fields[0].annotation)
        if below:
            is_list = isinstance(fields[0].get_default(call_default_factory=True), list) or Place((), fields[0].annotation, None).is_list
            yield from _keys(below, f"{prefix}{name}{'[]' if is_list else ''}.")
            continue
        given = [f"{tag(model)[1]}: " if tag(model)[0] == name else "" for model in models if name in model.model_fields]
        meanings = "; ".join(dict.fromkeys(word + field.description for word, field in zip(given, fields)))
        default = None if fields[0].is_required() else fields[0].get_default(call_default_factory=True)
        extra = fields[0].json_schema_extra
        yield Row(f"{prefix}{name}", _write(default), "required" if fields[0].is_required() else "default", extra["unit"], meanings, extra["source"])


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
