"""Reading: one sentence with file, key, finding and what is allowed, whatever is thrown at it."""
import copy
import pickle
import random
import subprocess
import sys
from pathlib import Path

import pytest

from pdhpc.scene.read import parse_scene, read_scene, scene_from_dict
from pdhpc.scene.schema import SceneError

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib

RUNS = Path(__file__).resolve().parents[3] / "runs"
GLASS = RUNS / "glass_branching.toml"


def sentence(text=None, *overrides):
    """Return the sentence of the SceneError of a scene."""
    with pytest.raises(SceneError) as caught:
        parse_scene(GLASS.read_text() if text is None else text, "file.toml", overrides)
    words = str(caught.value)
    assert "\n" not in words
    return words


@pytest.mark.parametrize("path", sorted(RUNS.glob("*.toml")), ids=lambda path: path.name)
def test_shipped_scenes_are_valid(path):
    assert read_scene(path).source == str(path)


@pytest.mark.parametrize("override, words", [
    ("particles.horizn=1e-3", ["particles.horizn is an unknown key", 'did you mean "horizon"', "spacing"]),
    ("load.pull_up.regoin=top", ["load 'pull_up': regoin is an unknown key", 'did you mean "region"']),
    ("load.pull_up.type=tracton", ["load 'pull_up': type = \"tracton\"", 'did you mean "traction"', "gravity"]),
    ("load.pull_up.time={function=\"rampp\"}", ["time.function = \"rampp\"", 'did you mean "ramp"']),
    ("load.pull_up.time={function=\"ramp\"}", ["end is missing"]),
    ("body.plate.shape=bocks", ["shape = \"bocks\"", 'did you mean "box"']),
    ("material.glass.density=-1", ["material 'glass': density = -1", "above 0"]),
    ("material.glass.density=\"heavy\"", ['density = "heavy"', "a number"]),
    ("material.glass.density=true", ["density = true", "a number"]),
    ("material.glass.density=nan", ["density = nan", "finite"]),
    ("material.glass.density=1e400", ["density = inf", "finite"]),
    ("particles.influence=cubic", ['influence = "cubic"', '"gaussian"']),
    ("dimension=2d", ['dimension = "2d"', "plane_stress"]),
    ("material=3", ["material = 3", "tables headed [[material]]"]),
    ("time=3", ["time = 3", "one table headed [time]"]),
    ("time.dt=soon", ['dt = "soon"', '"auto"']),
    ("time.dt=0", ["dt = 0", "above 0"]),
    ("output.fields=[\"demage\"]", ['fields[0] = "demage"', 'did you mean "damage"']),
    ("output.frames=2.5", ["frames = 2.5", "whole number"]),
    ("body.plate.name=\"über\"", ["name = \"über\"", "a letter"]),
    ("title=1", ["title = 1", "text"]),
    ("model=gfemm", ['model = "gfemm"', '"particles"', 'did you mean "gfem"']),
    ("tip.crack.name=1", ["name = 1", "a name in quotes"]),
    ("output.pictures=1", ["pictures = 1", "true or false"]),
])
def test_a_wrong_value_in_one_sentence(override, words):
    found = sentence(None, override)
    assert found.startswith(f"file.toml with --set {override}: ") and all(word in found for word in words), found


@pytest.mark.parametrize("text, words", [
    ("", ["the scene is empty", "dimension"]),
    ("[[", ["not valid TOML", "key"]),
    ("a = 1\na = 2", ["not valid TOML"]),
    ("x = " + "[" * 5000, ["nested too deeply"]),
    ("x = " + "[" * 50 + "]" * 50, ["nested too deeply", "12 levels"]),
    ("a." * 3000 + "a = 1", ["nested too deeply"]),
    ("x = " + "9" * 5000, ["file.toml: not valid TOML"]),
    ("[time]\nend = 0x" + "f" * 5000, ["time.end = a whole number of more than 60 digits"]),
    ("[time]\nend = 1979-05-27", ["time.end = 1979-05-27; allowed is a number"]),
    ("title = 'a'\n[time]\nend = 1\n[time]\n", ["not valid TOML", "line 4"]),
    ('dimension = "3d"\n[material]\nname = "a"', ["material = a single table [material]", "[[material]]"]),
])
def test_broken_files(text, words):
    found = sentence(text)
    assert all(word in found for word in words), found


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "latin").write_bytes("title = 'Stra\xdfe'".encode("latin-1"))
    for path, words in ((tmp_path / "none.toml", "No such file"), (tmp_path, "directory"), (tmp_path / "latin", "not UTF-8"), ("a\0b", "cannot be read")):
        with pytest.raises(SceneError, match=words):
            read_scene(path)


def test_a_byte_order_mark_is_no_error(tmp_path):
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbf" + GLASS.read_bytes())
    assert read_scene(tmp_path / "bom.toml").dim == 2


def test_unprintable_names_of_files_stay_on_one_line():
    for text in ("x", "[time]\nend = 1"):
        with pytest.raises(SceneError) as caught:
            parse_scene(text, "a\nb\udc80")
        assert str(caught.value).startswith("a\\nb\\udc80: ") and str(caught.value).isprintable()


def test_an_error_of_the_file_itself_is_not_blamed_on_the_overrides():
    text = GLASS.read_text().replace("density = 2235", "density = -1")
    assert sentence(text, "time.end=5e-6").startswith("file.toml: material 'glass': density = -1")
    assert sentence(text, "load.1.value=3").startswith("file.toml: material 'glass': density = -1")  # the first of two errors


def test_overrides_that_only_together_break_a_rule_are_both_named():
    found = sentence(None, "body.plate.lower=[0.05, 0.0]", "time.end=42e-6")
    assert found.startswith("file.toml with --set body.plate.lower=[0.05, 0.0] --set time.end=42e-6: region 'bottom'"), found


def test_overrides_leave_the_file_s_tables_alone_and_the_last_one_wins():
    assert parse_scene(GLASS.read_text(), "f", ["time.end=42e-6", "time.end=41e-6"]).time.end == 41e-6
    assert parse_scene(GLASS.read_text(), "f").time.end == 43e-6


def test_errors_survive_pickling():
    with pytest.raises(SceneError) as caught:
        parse_scene(GLASS.read_text(), "f", ["time.dt=0"])
    copied = pickle.loads(pickle.dumps(caught.value))
    assert str(copied) == str(caught.value) and copied.where == "time.dt"


def test_reading_imports_nothing_heavy():
    code = "import sys, pdhpc.scene.read; print(*{'numba', 'mpi4py', 'numpy', 'h5py'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_file_of_unreasonable_size(tmp_path):
    with open(tmp_path / "big.toml", "wb") as file:
        file.truncate(20_000_000)
    with pytest.raises(SceneError, match="larger than 10000000 bytes"):
        read_scene(tmp_path / "big.toml")


def test_overrides_reach_everything():
    changes = ["time.end=5e-6", "load.pull_up.value=[0.0, 1.0]", "load.1.value=[0, -1]", "title=Bare words", "damage.no_fail=[\"top\", \"bottom\", \"top_edge\", \"bottom_edge\"]",
               "output.every=1e-7", "body.plate.hole=[{shape=\"disk\", center=[0.08, 0.0], radius=0.002}]"]
    scene = parse_scene(GLASS.read_text(), "f", changes)
    assert scene.time.end == 5e-6 and scene.load[0].value == [0.0, 1.0] and scene.load[1].value == [0.0, -1.0] and scene.title == "Bare words"
    assert scene.body[0].hole[0].radius == 0.002


@pytest.mark.parametrize("override, words", [
    ("time.end", "section.key=value"), ("=3", "section.key=value"), ("load.pul_up.value=[0,1]", 'no entry "pul_up"'),
    ("load.7.value=[0,1]", "index below 2"), ("time.end.deep=1", "holds no keys"), ("..=1", "section.key=value"),
])
def test_bad_overrides_say_where_they_come_from(override, words):
    found = sentence(None, override)
    assert found.startswith(f"--set {override}") and words in found


VALUES = [None, True, -1, 0, 3, 1e300, -1e-300, float("nan"), float("inf"), "", "all", "é\u202e\0", [], [1], [[]], {}, {"a": 1}, [{}], "x" * 10_000, 10**30, 10**5000, [0.0, "free"], ["top"]]


def mutate(data, choose):
    """Change, remove, rename or add one thing somewhere in nested tables."""
    spots, stack = [], [data]
    while stack:
        node = stack.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node))
        for key in keys:
            spots.append((node, key))
            if isinstance(node[key], (dict, list)):
                stack.append(node[key])
    node, key = choose.choice(spots)
    action = choose.randrange(4)
    if action == 0:
        del node[key]
    elif action == 1 and isinstance(node, dict):
        node[str(key) + choose.choice("sx_")] = node.pop(key)
    elif action == 2 and isinstance(node, dict):
        node[choose.choice(["shape", "type", "name", "region", "value", "", "ü"])] = copy.deepcopy(choose.choice(VALUES))
    else:
        node[key] = copy.deepcopy(choose.choice(VALUES))


def test_thousands_of_broken_scenes_raise_nothing_but_scene_errors():
    choose, refused = random.Random(1), 0
    sources = [tomllib.loads(path.read_text()) for path in sorted(RUNS.glob("*.toml"))]
    for _ in range(3000):
        data = copy.deepcopy(choose.choice(sources))
        for _ in range(choose.randint(1, 3)):
            mutate(data, choose)
        try:
            scene_from_dict(data, "f")
        except SceneError as error:
            refused += 1
            assert str(error).startswith("f: ") and "\n" not in str(error) and len(str(error)) < 2000, error
    assert refused > 2000
