"""Find one's way in the models of the language: which tables and keys stand where."""
import typing
from typing import Any, List, NamedTuple, Optional

from pdhpc.scene.fields import Table
from pdhpc.scene.schema import Scene

_TAGS = ("shape", "type", "function")  # keys that tell the members of a union of tables apart


class Place(NamedTuple):
    """A place in a scene: its path of keys and list indices, the annotation of what stands there, and the field when it is a key of a table."""

    path: tuple
    annotation: Any
    field: Optional[Any]

    @property
    def tables(self):
        """The Table models one of which stands here; none for a plain value."""
        return [] if self.is_list else members(self.annotation)

    @property
    def is_list(self):
        """Whether a list stands here."""
        return typing.get_origin(_required(self.annotation)) is list


def members(annotation) -> List[type]:
    """Return the Table models inside an annotation, with lists, optionals and unions opened."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return [annotation]
    return [model for argument in typing.get_args(annotation) for model in members(argument)]


def tag(model):
    """Return (word, tag) that tells a member of a union of tables apart, such as ("shape", "box"), or (None, None)."""
    for word in _TAGS:
        if word in model.model_fields:
            return word, typing.get_args(model.model_fields[word].annotation)[0]
    return None, None


def keys(tables):
    """Return the keys of Table models in the order of the schema, each once."""
    return list(dict.fromkeys(name for model in tables for name in model.model_fields))


def locate(location):
    """Return the Place of a location that pydantic reports: keys, list indices, and the tag of each union of tables on the way."""
    path, annotation, field = (), Scene, None
    for word in location:
        tables = [] if typing.get_origin(annotation) is list else members(annotation)
        if len(tables) > 1:
            annotation, field = next(model for model in tables if tag(model)[1] == word), None
        elif tables:
            field = tables[0].model_fields.get(word)
            path, annotation = path + (word,), _required(field.annotation) if field else None
        else:
            path, annotation, field = path + (word,), _item(annotation), None
    return Place(path, annotation, field)


def homes(word):
    """Return the headings of all tables that have the key `word`, such as "[particles]" or "[[body]]"."""
    found = [f"[[{name}]]" if typing.get_origin(field.annotation) is list else f"[{name}]"
             for name, field in Scene.model_fields.items() if word in keys(members(field.annotation))]
    plain = word in Scene.model_fields and not members(Scene.model_fields[word].annotation)
    return found + (["the top level, above the first section"] if plain else [])


def choices(annotation):
    """Return the words of a Literal as they stand in a scene; none for anything else."""
    plain = _required(annotation)
    return [f'"{word}"' for word in typing.get_args(plain)] if typing.get_origin(plain) is typing.Literal else []


def _required(annotation):
    """Return an annotation without Annotated and Optional around it."""
    if typing.get_origin(annotation) is typing.Annotated:
        return _required(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) is typing.Union:
        rest = [argument for argument in typing.get_args(annotation) if argument is not type(None)]
        if len(rest) == 1:
            return _required(rest[0])
    return annotation


def _item(annotation):
    """Return the annotation of the entries of a list, or None."""
    plain = _required(annotation)
    return _required(typing.get_args(plain)[0]) if typing.get_origin(plain) is list else None
