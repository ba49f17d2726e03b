"""Building blocks of the schema: strict tables, numbers, vectors, and keys that know their unit, meaning and source."""
import math
from typing import Annotated, Any, List, Optional

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

LARGEST = 1e60


def printable(value, longest=60):
    """Return a value as text that fits a sentence: one line, no control characters, shortened."""
    text = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in str(value)[: longest + 1])
    return text if len(text) <= longest else text[: longest - 3] + "..."


class Rule(ValueError):
    """A broken rule: `key` (relative to its table), what was `found`, what is `allowed`."""

    def __init__(self, key, found, allowed):
        super().__init__(f"{key} = {printable(found, 200)}; allowed is {allowed}")
        self.key, self.found, self.allowed = key, found, allowed


class Table(BaseModel):
    """A table of the scene: unknown keys are refused, values are not converted, and nothing changes after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def key(meaning, unit="", source="", default=...):
    """Return a pydantic field with its meaning, unit and the source of its formula; `...` makes it required."""
    extra = {"unit": unit, "source": source}
    if isinstance(default, (list, dict)):
        return Field(default_factory=lambda: type(default)(default), description=meaning, json_schema_extra=extra)
    return Field(default, description=meaning, json_schema_extra=extra)


def _number(value: Any) -> float:
    """Take an integer or a float, nothing else, finite and of sane size."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("a number")
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise ValueError(f"a finite number below {LARGEST:g} in size")
    return float(value)


def _positive(value: float) -> float:
    if value <= 0:
        raise ValueError("a number above 0")
    return value


def _not_negative(value: float) -> float:
    if value < 0:
        raise ValueError("a number of at least 0")
    return value


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1 or value > 10**9:
        raise ValueError("a whole number from 1 to 1000000000")
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("a text in quotes")
    return value


def _name(value: Any) -> str:
    value = _text(value)
    head, rest = value[:1], value.replace("_", "").replace("-", "")
    if not (head.isascii() and head.isalpha() and rest.isascii() and rest.isalnum()) or len(value) > 60:
        raise ValueError("a name: a letter, then letters, digits, _ or -")
    return value


def _list(value: Any) -> list:
    if not isinstance(value, list) or not value:
        raise ValueError("a list with at least one entry in [ ]")
    return value


def _optional_list(value: Any) -> list:
    if not isinstance(value, list):
        raise ValueError("a list in [ ]")
    return value


def free_or_number(value: Any):
    """Take a number or the word "free"."""
    if value == "free":
        return value
    try:
        return _number(value)
    except ValueError:
        raise ValueError('a number or "free"') from None


Number = Annotated[float, BeforeValidator(_number)]
Positive = Annotated[float, BeforeValidator(_number), AfterValidator(_positive)]
NotNegative = Annotated[float, BeforeValidator(_number), AfterValidator(_not_negative)]
Whole = Annotated[int, BeforeValidator(_whole)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Text = Annotated[str, BeforeValidator(_text)]
Name = Annotated[str, BeforeValidator(_name)]
Vector = Annotated[List[Number], BeforeValidator(_list)]
Names = Annotated[List[Name], BeforeValidator(_optional_list)]
Numbers = Annotated[List[Number], BeforeValidator(_list)]
Matrix = Annotated[List[Vector], BeforeValidator(_list)]


def length(vector):
    """Return the Euclidean length of a vector."""
    return math.sqrt(sum(x * x for x in vector))


def check_vector(name, vector: Optional[list], dim):
    """Raise a Rule unless a vector is absent or has `dim` components."""
    if vector is not None and len(vector) != dim:
        raise Rule(name, f"{vector} ({len(vector)} components)", f"{dim} components")


def check_direction(name, vector, dim):
    """Raise a Rule unless a vector has `dim` components and is not zero."""
    check_vector(name, vector, dim)
    if vector is not None and length(vector) == 0:
        raise Rule(name, vector, "a vector that is not zero")
