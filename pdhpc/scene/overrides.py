"""Change keys of a scene from the command line: --set section.key=value."""
import re
import typing

from pdhpc.scene import vocabulary
from pdhpc.scene.fields import printable
from pdhpc.scene.schema import SceneError
from pdhpc.scene.sentences import listed, nearest

try:
    import tomllib
except ModuleNotFoundError:  # Python < 3.11
    import tomli as tomllib

_FORM = "section.key=value, with entries of lists by index from 0, as load.1 or load[1], or by name"
_INDEX = re.compile(r"\[\s*([0-9]{1,9})\s*\]")
_OPENERS = tuple("[{\"'")  # of values of TOML that are not bare


class BadOverride(SceneError):
    """An override that cannot be applied."""


def apply(data, override):
    """Set one key in the tables `data` from "section.key=value" and return its path of keys and list indices.

    The value is TOML; anything else is taken as a text, unless it opens a list, table or string. Entries of lists are given by index from 0, as load.1 or
    load[1], or by their name.

    Raises
    ------
    BadOverride: no "=", a path that leads nowhere, or a value that begins like TOML but is not.
    """
    if any(0xD800 <= ord(each) < 0xE000 for each in override):
        raise _bad(override, "it is not UTF-8", "a text in UTF-8")
    left, equals, text = override.partition("=")
    words = [word.strip() for word in _INDEX.sub(r".\1", left).split(".")]
    if not equals or not all(words):
        raise _bad(override, "it does not say what to set", _FORM)
    if any(set(word) & set("[]") for word in words):
        raise _bad(override, "an index is a whole number of at least 0", _FORM)
    value = _parse(text.strip(), override)
    target, path = data, ()
    for word in words[:-1]:
        step = _step(target, word, path, override)
        target, path = target[step], path + (step,)
    step = _step(target, words[-1], path, override, last=True)
    target[step] = value
    return path + (step,)


def _bad(override, found, allowed):
    return BadOverride(f"--set {printable(override)}: {found}; allowed is {allowed}")


def _parse(text, override):
    """Return a value of TOML, or the text itself when it is none."""
    try:
        table = tomllib.loads(f"value = {text}")
        if list(table) == ["value"]:
            return table["value"]
    except (ValueError, RecursionError):  # TOMLDecodeError is a ValueError
        if text.isprintable() and not text.startswith(_OPENERS):
            return text
    raise _bad(override, f"{printable(text)[:60]} is not a TOML value", "one value, such as 1e-3, [0.0, 1.0], true or a word")


def _step(target, word, path, override, last=False):
    """Return the key or index that a word means in a table or list; a missing table on the way is made."""
    spot = ".".join(str(step) for step in path)
    if isinstance(target, dict):
        if word not in target and not last:
            target[word] = [] if _is_list(path, word) else {}
        return word
    if not isinstance(target, list):
        raise _bad(override, f"{spot} holds no keys", _FORM)
    names = [table.get("name") if isinstance(table, dict) else None for table in target]
    if word in names:
        return names.index(word)
    if re.fullmatch("[0-9]{1,9}", word) and int(word) < len(target):
        return int(word)
    known = [name for name in names if isinstance(name, str)]
    offer = f"an index below {len(target)}" if target else f"no entry, as the scene has no [[{spot}]]"
    raise _bad(override, f'{spot} has no entry "{printable(word)}"', offer + (f" or one of {listed(known)}{nearest(word, known)}" if known else ""))


def _is_list(path, word):
    """Whether a missing key at a path would hold a list of tables."""
    models = [vocabulary.Scene]
    for step in path:
        if not isinstance(step, int):
            models = [member for model in models if step in model.model_fields for member in vocabulary.members(model.model_fields[step].annotation)]
    fields = [model.model_fields[word] for model in models if word in model.model_fields]
    return any(typing.get_origin(field.annotation) is list for field in fields)
