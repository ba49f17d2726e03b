"""Explain a scene: every key with its value, origin, unit, meaning and source; and the JSON schema, both from the models of schema.py."""
import typing
from typing import NamedTuple, Union

from pydantic import BaseModel

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
    """Return a Row for every key of the scene, given and default."""
    return list(_rows(scene, ""))


def _rows(table, prefix):
    for name, field in type(table).model_fields.items():
        value, path = getattr(table, name), f"{prefix}{name}"
        if isinstance(value, BaseModel):
            yield from _rows(value, f"{path}.")
        elif isinstance(value, list) and value and isinstance(value[0], BaseModel):
            for number, each in enumerate(value):
                yield from _rows(each, f"{path}.{getattr(each, 'name', None) or number}.")
        else:
            extra = field.json_schema_extra or {}
            origin = "given" if name in table.model_fields_set else "default"
            yield Row(path, "-" if value is None else _show(value), origin, extra.get("unit", ""), field.description or "", extra.get("source", ""))


def _show(value):
    return str(value).lower() if isinstance(value, bool) else str(value)


def json_schema():
    """Return the JSON schema of scenes, for editors."""
    return Scene.model_json_schema()


def _members(annotation):
    """Return the Table models inside an annotation (lists, optionals and unions opened)."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    found = []
    for argument in typing.get_args(annotation):
        found += _members(argument)
    return found


def _tag(model):
    """Return (word, tag) of a member of a union, such as ("shape", "box")."""
    for word in ("shape", "type", "function"):
        if word in model.model_fields:
            return word, typing.get_args(model.model_fields[word].annotation)[0]
    return None, None


def model_at(location):
    """Return the Table model that a pydantic location leads to, or None."""
    models = [Scene]
    for word in location:
        if isinstance(word, int):
            continue
        tagged = [model for model in models if _tag(model)[1] == word]
        if tagged and not any(word in model.model_fields for model in models):
            models = tagged
            continue
        fields = [model.model_fields[word] for model in models if word in model.model_fields]
        models = _members(fields[0].annotation) if fields else []
    return models[0] if models else None


def tags_at(location):
    """Return (word, tags) of the union of tables that a pydantic location leads to."""
    models, names = [Scene], [word for word in location if not isinstance(word, int)]
    for word in names:
        tagged = [model for model in models if _tag(model)[1] == word]
        if tagged and not any(word in model.model_fields for model in models):
            models = tagged
        else:
            fields = [model.model_fields[word] for model in models if word in model.model_fields]
            models = _members(fields[0].annotation) if fields else []
    tags = [_tag(model) for model in models]
    return (tags[0][0] if tags else "shape"), [tag for _, tag in tags if tag]


def meaning_of(location):
    """Return the meaning of the key that a pydantic location leads to, for the sentence on a missing key."""
    model = model_at(location[:-1])
    field = model.model_fields.get(location[-1]) if model else None
    if field is None:
        return "a value"
    unit = (field.json_schema_extra or {}).get("unit")
    return (field.description or "a value") + (f", {unit}" if unit else "")
