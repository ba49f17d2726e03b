"""One sentence for what is wrong with the tables of a scene, out of the errors that pydantic found in them."""
import difflib

from pdhpc.scene import vocabulary
from pdhpc.scene.fields import show

_LISTED = 16  # names that a sentence lists before it stops
_LONGEST = 60  # characters of a name
_RANK = {"extra_forbidden": 0, "union_tag_not_found": 1, "missing": 3}


def nearest(word, words):
    """Return ' (did you mean "..."?)' for the nearest of `words`, or nothing."""
    text = word[:_LONGEST] if isinstance(word, str) else show(word)
    found = difflib.get_close_matches(text.lower(), list(words), n=1, cutoff=0.5)
    return f' (did you mean "{found[0]}"?)' if found else ""


def listed(names):
    """Return names separated by commas, the first few of many."""
    names = list(names)
    return ", ".join(names[:_LISTED]) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")


def where(data, path):
    """Return a path as words: section and key, tables of lists by their name where they have one, such as "load 'pull': value[1]"."""
    text, value, joint = "", data, ""
    for step in path:
        value = _entry(value, step)
        if not isinstance(step, int):
            text, joint = text + joint + _key(step), "."
        elif isinstance(value, dict):
            text, joint = text + (f" '{_name(value)}'" if _name(value) else f"[{step}]"), ": "
        else:
            text, joint = text + f"[{step}]", ": "
    return text


def sentence(data, errors):
    """Return (key, sentence) of the most telling error: an unknown key first, as it also causes missing ones, then wrong values, then missing keys."""
    error = min(errors, key=lambda each: _RANK.get(each["type"], 2))
    place, kind = vocabulary.locate(error["loc"]), error["type"]
    spot, value = where(data, place.path), _value(data, place.path)
    if kind == "extra_forbidden":
        parent = vocabulary.locate(error["loc"][:-1])
        return spot, _unknown(data, place.path, parent.tables)
    if kind == "missing":
        return spot, f"{spot} is missing; allowed is {_meaning(place)}"
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        return _no_member(data, place, spot, value)
    if place.is_list and vocabulary.members(place.annotation) and (not isinstance(value, list) or not value):
        return spot, f"{spot} = {_table_or(value, spot)}; allowed is one or more tables headed [[{_heading(place.path)}]]"
    if place.tables:
        return spot, f"{spot} = {_table_or(value, spot)}; allowed is {_form(place)}"
    return spot, f"{spot} = {show(value)}; allowed is {_allowed(error, place, value)}"


def _entry(value, step):
    if isinstance(value, dict):
        return value.get(step)
    return value[step] if isinstance(value, list) and isinstance(step, int) and step < len(value) else None


def _value(data, path):
    for step in path:
        data = _entry(data, step)
    return data


def _name(table):
    """Return the name of a table when it can stand in a sentence."""
    name = table.get("name")
    return name if isinstance(name, str) and 0 < len(name) <= _LONGEST and name.isprintable() else None


def _key(word):
    """Return a key as it stands in a scene: bare, or quoted when it holds anything unusual."""
    word = str(word)
    return word if word.replace("_", "").replace("-", "").isalnum() and word.isascii() and len(word) <= _LONGEST else show(word)


def _heading(path):
    return ".".join(step for step in path if not isinstance(step, int))


def _table_or(value, spot):
    """Return what was found where one table, or a list of them, is wanted."""
    if isinstance(value, dict):
        return f"a single table [{spot}]" if spot.isidentifier() else "a single table"
    if isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
        return "a list of tables"
    return show(value)


def _form(place):
    """Return how one table is written at a place: as a section, as an entry of [[...]], or inline."""
    if isinstance(place.path[-1], int):
        return f"a table headed [[{_heading(place.path)}]]"
    return f"one table headed [{place.path[0]}]" if len(place.path) == 1 else "a table in { }"


def _unknown(data, path, tables):
    """Return the sentence for an unknown key, with the nearest valid one or the section it belongs to."""
    word, known = str(path[-1]), vocabulary.keys(tables)
    parent = where(data, path[:-1]) or "the top level"
    homes = vocabulary.homes(word)
    hint = f' ("{word}" belongs to {" and ".join(homes)})' if homes else nearest(word, known)
    return f"{where(data, path)} is an unknown key; allowed in {parent} is {', '.join(known)}{hint}"


def _no_member(data, place, spot, value):
    """Return (key, sentence) for a table whose shape, type or function is misspelt, missing or unknown."""
    word = vocabulary.tag(place.tables[0])[0]
    tags = [vocabulary.tag(model)[1] for model in place.tables]
    listing = ", ".join(f'"{each}"' for each in tags)
    if not isinstance(value, dict):
        return spot, f"{spot} = {_table_or(value, spot)}; allowed is {_form(place)} with {word} = one of {listing}"
    for each in value:
        if each not in vocabulary.keys(place.tables):
            path = place.path + (each,)
            return where(data, path), _unknown(data, path, place.tables)
    key = where(data, place.path + (word,))
    if word not in value:
        return key, f"{key} is missing; allowed is {listing}"
    return key, f"{key} = {show(value[word])}; allowed is {listing}{nearest(value[word], tags)}"


def _allowed(error, place, value):
    """Return in words what is allowed in place of a plain value."""
    words = vocabulary.choices(place.annotation)
    if words:
        offer = ", ".join(words) if len(words) > 1 else f"{words[0]}, the only one offered"
        return offer + nearest(value, [word.strip('"') for word in words])
    if error["type"] == "value_error":
        return error["msg"].replace("Value error, ", "", 1)
    return error["msg"][:1].lower() + error["msg"][1:]


def _meaning(place):
    """Return what a missing key would hold."""
    words = vocabulary.choices(place.annotation)
    if words:
        return ", ".join(words)
    if vocabulary.members(place.annotation):
        return f"one or more tables headed [[{_heading(place.path)}]]" if place.is_list else _form(place)
    unit = (place.field.json_schema_extra or {}).get("unit")
    return f"a value: {place.field.description}" + (f", {unit}" if unit else "")
