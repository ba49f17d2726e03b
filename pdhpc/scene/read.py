"""Read a scene: TOML in, a validated Scene out, or one sentence that says what is wrong."""
import difflib
from pathlib import Path

from pydantic import ValidationError

from pdhpc.scene import rules
from pdhpc.scene.fields import Rule, printable
from pdhpc.scene.schema import Scene, SceneError

try:
    import tomllib
except ModuleNotFoundError:  # Python < 3.11
    import tomli as tomllib

_LARGEST_FILE = 10_000_000  # bytes
_TAGS = ("shape", "type", "function")


def read_scene(path, overrides=()):
    """Return the Scene of a TOML file, with `overrides` ("section.key=value") applied.

    Raises
    ------
    SceneError: one sentence with file, key, what was found and what is allowed.
    """
    return parse_scene(read_text(path), str(path), overrides)


def read_text(path):
    """Return the text of a scene file; a SceneError says why it cannot be read."""
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(f"{path}: cannot be read ({reason}); allowed is a TOML scene file") from None
    if len(data) > _LARGEST_FILE:
        raise SceneError(f"{path}: {len(data)} bytes; allowed is a scene of at most {_LARGEST_FILE} bytes")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: byte {error.start} is not UTF-8; allowed is a TOML scene in UTF-8") from None


def parse_scene(text, name, overrides=()):
    """Return the Scene of a TOML text; `name` is the file named in errors."""
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else "nested too deeply"
        raise SceneError(f"{name}: not valid TOML: {printable(reason, 200)}") from None
    for override in overrides:
        _apply(data, override)
    return scene_from_dict(data, name)


def scene_from_dict(data, name):
    """Return the validated Scene of a dict of its tables."""
    try:
        scene = Scene.model_validate(data)
        rules.check(scene)
    except ValidationError as error:
        raise SceneError(f"{name}: {_sentence(data, error.errors())}") from None
    except Rule as rule:
        raise SceneError(f"{name}: {rule}") from None
    except RecursionError:
        raise SceneError(f"{name}: tables are nested too deeply") from None
    scene._source = name
    return scene


def _sentence(data, errors):
    """Return the sentence of the most telling error: an unknown key first, as it also causes missing ones."""
    def rank(error):
        return {"extra_forbidden": 0, "missing": 2}.get(error["type"], 1)

    error = min(errors, key=rank)
    path, value = _walk(data, error["loc"])
    where = _where(data, path)
    kind, context = error["type"], error.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(path, where, errors, data)
    if kind == "missing":
        return f"{where} is missing; allowed is {_meaning(error['loc'])}"
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        word = context["discriminator"].strip("'()") if "discriminator" in context else "shape"
        return _wrong_tag(where, value, word, error["loc"])
    return f"{where} = {_show(value)}; allowed is {_allowed(kind, context, error)}"


def _walk(data, location):
    """Return (path of keys and indices, value found there), dropping the union tags that pydantic puts into locations."""
    path, value = [], data
    for word in location:
        if isinstance(value, dict) and word in value and not _is_tag_of(value, word):
            path, value = path + [word], value[word]
        elif isinstance(value, list) and isinstance(word, int) and word < len(value):
            path, value = path + [word], value[word]
        elif isinstance(value, dict) and not _is_tag_of(value, word):
            path, value = path + [word], None
    return path, value


def _is_tag_of(table, word):
    return any(table.get(tag) == word for tag in _TAGS) and word not in table


def _where(data, path):
    """Return a path as words: section and key, tables of lists by their name where they have one."""
    words, value = [], data
    for step in path:
        value = value[step] if isinstance(value, (dict, list)) and _has(value, step) else None
        if isinstance(step, int):
            label = value.get("name") if isinstance(value, dict) else None
            words[-1] += f" '{printable(label, 30)}':" if isinstance(label, str) and label else f"[{step}]" + (":" if isinstance(value, dict) else "")
        else:
            words.append(printable(step))
    text = ""
    for word in words:
        text += word if not text else (" " if text.endswith(":") else ".") + word
    return text.rstrip(":") or "the scene"


def _has(value, step):
    return step in value if isinstance(value, dict) else isinstance(step, int) and step < len(value)


def _model_at(location):
    """Return the Table class whose keys a pydantic location ends in, or None."""
    from pdhpc.scene.explain import model_at

    return model_at(location)


def _unknown_key(path, where, errors, data):
    """Return the sentence for an unknown key, with the nearest valid one."""
    location = next(error["loc"] for error in errors if error["type"] == "extra_forbidden")
    model = _model_at(location[:-1])
    keys = sorted(model.model_fields) if model else []
    parent = _where(data, path[:-1]) if len(path) > 1 else "the top level"
    found = difflib.get_close_matches(str(path[-1]), keys, n=1, cutoff=0.5)
    hint = f' (did you mean "{found[0]}"?)' if found else ""
    return f"{where} is an unknown key; allowed in {parent} is {', '.join(keys)}{hint}"


def _wrong_tag(where, value, word, location):
    """Return the sentence for a table whose shape, type or function is missing or unknown."""
    from pdhpc.scene.explain import tags_at

    word, tags = tags_at(location)
    if not isinstance(value, dict):
        return f"{where} = {_show(value)}; allowed is a table with {word} = {' | '.join(tags)}"
    if word not in value:
        return f"{where}: {word} is missing; allowed is {', '.join(tags)}"
    found = difflib.get_close_matches(str(value[word]), tags, n=1, cutoff=0.5)
    return f"{where}: {word} = {_show(value[word])}; allowed is {', '.join(tags)}" + (f' (did you mean "{found[0]}"?)' if found else "")


def _allowed(kind, context, error):
    """Return what is allowed instead, in words."""
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        expected = context["expected"].replace("'", '"')
        found = difflib.get_close_matches(str(error["input"]), expected.replace('"', "").replace(" or ", ", ").split(", "), n=1, cutoff=0.5)
        return expected + (f' (did you mean "{found[0]}"?)' if found else "")
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return "a table (one [section] of keys)"
    return error["msg"][:1].lower() + error["msg"][1:]


def _meaning(location):
    from pdhpc.scene.explain import meaning_of

    return meaning_of(location)


def _show(value):
    """Return a value as it could stand in a scene, shortened."""
    if isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, dict):
        return "a table"
    else:
        text = str(value)
    return printable(text)


def _apply(data, override):
    """Set one key of the scene's tables from "section.key=value"."""
    path, equals, text = override.partition("=")
    words = path.strip().split(".")
    if not equals or not all(words):
        raise SceneError(f"--set {printable(override, 100)}: allowed is section.key=value")
    value, target = _value(text.strip()), data
    for number, word in enumerate(words[:-1]):
        target = _step(target, word, override, create=number == 0)
    if isinstance(target, list):
        target[_index(target, words[-1], override)] = value
    elif isinstance(target, dict):
        target[words[-1]] = value
    else:
        raise SceneError(f"--set {printable(override, 100)}: {'.'.join(words[:-1])} is no table; allowed is section.key=value")


def _value(text):
    """Return a TOML value, or the text itself when it is a bare word."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, ValueError, RecursionError, KeyError):
        return text


def _step(target, word, override, create):
    if isinstance(target, list):
        return target[_index(target, word, override)]
    if isinstance(target, dict):
        if word not in target and create and word in Scene.model_fields:
            target[word] = {}
        if word in target:
            return target[word]
        hint = rules.nearest(word, list(target))
        raise SceneError(f"--set {printable(override, 100)}: {word} is not in the scene; allowed is one of {', '.join(sorted(target))}{hint}")
    raise SceneError(f"--set {printable(override, 100)}: {word} leads into a value that is no table; allowed is section.key=value")


def _index(tables, word, override):
    """Return the index of a list entry given by number or by name."""
    names = [table.get("name") if isinstance(table, dict) else None for table in tables]
    if word in names:
        return names.index(word)
    if word.isdigit() and int(word) < len(tables):
        return int(word)
    known = [str(name) for name in names if name]
    raise SceneError(f"--set {printable(override, 100)}: no entry {word}; allowed is an index below {len(tables)}" + (f" or one of {', '.join(known)}" if known else ""))
