"""Read a scene: TOML in, a validated Scene out, or one sentence that says what is wrong."""
import copy

from pydantic import ValidationError

from pdhpc.scene import overrides as changes
from pdhpc.scene import rules, sentences
from pdhpc.scene.fields import LARGEST, Rule, printable, show
from pdhpc.scene.schema import Scene, SceneError

try:
    import tomllib
except ModuleNotFoundError:  # Python < 3.11
    import tomli as tomllib

_LARGEST_FILE = 10_000_000  # bytes
_DEEPEST = 12  # levels of tables and lists; the language uses six


def read_scene(path, overrides=()):
    """Return the Scene of a TOML file, with `overrides` ("section.key=value") applied.

    Raises
    ------
    SceneError: one sentence with file, key, what was found and what is allowed.
    """
    return parse_scene(read_text(path), str(path), overrides)


def read_text(path):
    """Return the text of a scene file; a SceneError says why it cannot be read."""
    name = printable(str(path))
    try:
        with open(path, "rb") as file:
            data = file.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(f"{name}: cannot be read ({reason}); allowed is a TOML scene file") from None
    if len(data) > _LARGEST_FILE:
        raise SceneError(f"{name}: larger than {_LARGEST_FILE} bytes; allowed is a TOML scene file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{name}: byte {error.start} is not UTF-8; allowed is a TOML scene file in UTF-8") from None


def parse_scene(text, name, overrides=()):
    """Return the Scene of a TOML text with `overrides` applied; `name` is the file named in errors.

    Raises
    ------
    SceneError: as read_scene; it names the overrides that it comes from.
    """
    return changed_scene(_tables(text, printable(name)), name, overrides)


def changed_scene(data, name, overrides):
    """Return the Scene of a dict of tables with `overrides` applied; see parse_scene."""
    changed, paths = copy.deepcopy(data), {}
    for override in overrides:
        paths[override] = changes.apply(changed, override)
    try:
        return scene_from_dict(changed, name)
    except SceneError as error:
        guilty = _guilty(error, data, changed, paths)
        if not guilty:
            raise
        rest = str(error)[len(printable(name)) :]
        words = " ".join(f"--set {printable(override)}" for override in guilty)
        raise SceneError(f"{printable(name)} with {words}{rest}", error.where) from None


def scene_from_dict(data, name):
    """Return the validated Scene of a dict of its tables, such as Scene.resolved() returns; `name` is the file named in errors."""
    label = printable(name)
    if not data:
        raise SceneError(f"{label}: the scene is empty; allowed is a scene with dimension, particles, material, body and time")
    _check_sizes(data, label)
    try:
        scene = Scene.model_validate(data)
        rules.check(scene)
    except ValidationError as error:
        where, sentence = sentences.sentence(data, error.errors(include_url=False))
        raise SceneError(f"{label}: {sentence}", where) from None
    except Rule as rule:
        raise SceneError(f"{label}: {rule}", rule.key) from None
    scene._source = label
    return scene


def _tables(text, name):
    """Return the tables of a TOML text as a dict."""
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{name}: nested too deeply; allowed are {_DEEPEST} levels of tables and lists") from None
    except ValueError as error:  # TOMLDecodeError, and integers too long to convert
        reason = printable(str(error).splitlines()[0]).split("; use sys.")[0]
        raise SceneError(f"{name}: not valid TOML: {reason}; allowed is TOML, see toml.io") from None
    _check_sizes(data, name)
    return data


def _check_sizes(data, name):
    """Raise a SceneError for tables and lists nested deeper, or whole numbers longer, than code that walks or prints them can take."""
    level = [((), data)]
    for _ in range(_DEEPEST):
        inner = []
        for path, holder in level:
            for step, value in holder.items() if isinstance(holder, dict) else enumerate(holder):
                if isinstance(value, (dict, list)):
                    inner.append((path + (step,), value))
                elif isinstance(value, int) and abs(value) > LARGEST:
                    key = sentences.where(data, path + (step,))
                    raise SceneError(f"{name}: {key} = {show(value)}; allowed is a number below {LARGEST:g}", key)
        level = inner
    if level:
        raise SceneError(f"{name}: nested too deeply; allowed are {_DEEPEST} levels of tables and lists")


def _guilty(error, data, changed, paths):
    """Return the overrides that an error comes from: those whose key it names, or all when the file alone is valid."""
    named = [override for override, path in paths.items() if _same_key(sentences.where(changed, path), error.where)]
    if named or not paths:
        return named
    try:
        scene_from_dict(data, "")
    except SceneError:
        return []
    return list(paths)


def _same_key(one, other):
    """Whether one of two keys is the other or lies below it."""
    short, long = sorted((one, other), key=len)
    return bool(short) and long.startswith(short) and long[len(short) :][:1] in ("", ".", ":", "[")
