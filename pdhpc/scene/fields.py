"""Building blocks of the schema: strict tables, numbers, vectors, and keys that know their unit, meaning and source."""
import math
import re
from typing import Annotated, Any, List, Optional

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import core_schema

LARGEST = 1e60  # bounds on the size of numbers: their squares and cubes neither overflow nor vanish
SMALLEST = 1e-60
_SHOWN = 60  # characters of a value in a sentence, and of a name
_NAME = "[A-Za-z][A-Za-z0-9_-]*"


class Rule(ValueError):
    """A broken rule: `key` (with its section, or relative to its table), what was `found`, what is `allowed`."""

    def __init__(self, key, found, allowed):
        self.key, self.found, self.allowed = key, found if isinstance(found, str) else show(found), allowed
        super().__init__(f"{self.key} = {self.found}; allowed is {allowed}")


class Table(BaseModel):
    """A table of the scene: unknown keys are refused, values are not converted, and nothing changes after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def key(meaning, unit="", source="", default=...):
    """Return a pydantic field with its meaning, unit and the source of its formula; `...` makes it required."""
    extra = {"unit": unit, "source": source}
    if isinstance(default, list):
        return Field(default_factory=lambda: list(default), description=meaning, json_schema_extra=extra)
    return Field(default, description=meaning, json_schema_extra=extra)


def printable(text):
    """Return a text in which line breaks, control characters and lone surrogates are escaped."""
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def show(value):
    """Return a value as it stands in a scene, on one line and shortened."""
    text = printable(_written(value))
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def _written(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_written(each) for each in value[:_SHOWN])}]"
    if isinstance(value, int) and abs(value) > LARGEST:
        return "a whole number of more than 60 digits"
    return str(value)


class Kind:
    """A kind of value: `take` returns it or raises a ValueError that says what is allowed; `schema` is its JSON schema."""

    def __init__(self, take, **schema):
        self.take, self.schema = take, schema

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_before_validator_function(self.take, handler(source))

    def __get_pydantic_json_schema__(self, schema, handler):
        return {**handler(schema), **self.schema}


def take_number(value: Any) -> float:
    """Take an integer or a float, nothing else, finite and of sane size."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("a number")
    if not (value == 0 or SMALLEST <= abs(value) <= LARGEST):
        raise ValueError(f"a finite number, 0 or of size {SMALLEST:g} to {LARGEST:g}")
    return float(value)


def _positive(value):
    value = take_number(value)
    if value <= 0:
        raise ValueError("a number above 0")
    return value


def _not_negative(value):
    value = take_number(value)
    if value < 0:
        raise ValueError("a number of at least 0")
    return value


def _share(value):
    if not 0 < take_number(value) <= 1:
        raise ValueError("a number above 0 and at most 1")
    return float(value)


def _fraction(value):
    if not 0 < take_number(value) < 1:
        raise ValueError("a number above 0 and below 1")
    return float(value)


def _whole(value):
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 10**6:
        raise ValueError("a whole number from 1 to 1000000")
    return value


def _integer(value):
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**53:
        raise ValueError("a whole number")
    return value


def _flag(value):
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def _text(value):
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError("a text in quotes, on one line and without control characters")
    return value


def _name(value):
    if not isinstance(value, str) or not re.fullmatch(_NAME, value) or len(value) > _SHOWN:
        raise ValueError(f"a name in quotes: a letter a-z or A-Z, then letters, digits, _ or -, at most {_SHOWN} in all")
    return value


def _list_of(what):
    """Return the Kind of a list that is not empty."""
    def take(value):
        """Take a list that is not empty."""
        if not isinstance(value, list) or not value:
            raise ValueError(f"a list of {what}")
        return value

    return Kind(take, minItems=1)


def _any_list(value):
    if not isinstance(value, list):
        raise ValueError("a list in [ ]")
    return value


def free_or_number(value):
    """Take a number or the word "free"."""
    if value == "free":
        return value
    try:
        return take_number(value)
    except ValueError as error:
        raise ValueError(f'{error} or "free"') from None


def _auto_or_ratio(value):
    if value == "auto":
        return value
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 1000:
        raise ValueError('"auto" or a whole number from 1 to 1000')
    return value


def _auto_or_positive(value):
    if value == "auto":
        return value
    try:
        return _positive(value)
    except ValueError as error:
        raise ValueError(f'"auto" or {error}') from None


Filled = _list_of("at least one entry in [ ]")
Listed = Kind(_any_list)
Number = Annotated[float, Kind(take_number)]
Positive = Annotated[float, Kind(_positive, exclusiveMinimum=0)]
NotNegative = Annotated[float, Kind(_not_negative, minimum=0)]
Share = Annotated[float, Kind(_share, exclusiveMinimum=0, maximum=1)]
Fraction = Annotated[float, Kind(_fraction, exclusiveMinimum=0, exclusiveMaximum=1)]
Whole = Annotated[int, Kind(_whole, minimum=1, maximum=10**6)]
Integer = Annotated[int, Kind(_integer)]
Flag = Annotated[bool, Kind(_flag)]
Text = Annotated[str, Kind(_text)]
Name = Annotated[str, Kind(_name, pattern=f"^{_NAME}$", maxLength=_SHOWN)]
FreeOrNumber = Annotated[Any, Kind(free_or_number, anyOf=[{"type": "number"}, {"const": "free"}])]
AutoOrPositive = Annotated[Any, Kind(_auto_or_positive, anyOf=[{"type": "number", "exclusiveMinimum": 0}, {"const": "auto"}])]
AutoOrRatio = Annotated[Any, Kind(_auto_or_ratio, anyOf=[{"type": "integer", "minimum": 1, "maximum": 1000}, {"const": "auto"}])]
Vector = Annotated[List[Number], _list_of("numbers such as [0.0, 1.0]")]
FreeVector = Annotated[List[FreeOrNumber], _list_of('numbers or "free" such as [0.0, "free"]')]
Names = Annotated[List[Name], Listed]
Numbers = Annotated[List[Number], _list_of("one or more numbers in [ ]")]
Matrix = Annotated[List[Vector], _list_of("lists such as [[0.0, 0.0], [0.0, 1.0]]")]


def length(vector):
    """Return the Euclidean length of a vector."""
    return math.sqrt(sum(x * x for x in vector))


def check_vector(name, vector: Optional[list], dim):
    """Raise a Rule unless a vector is absent or has `dim` components."""
    if vector is not None and len(vector) != dim:
        raise Rule(name, f"{show(vector)} ({len(vector)} components)", f"{dim} components in {dim}D")


def check_direction(name, vector, dim):
    """Raise a Rule unless a vector is absent, or has `dim` components and is not zero."""
    check_vector(name, vector, dim)
    if vector is not None and length(vector) == 0:
        raise Rule(name, vector, "a vector that is not zero")
