"""Reading: one sentence with file, key, finding and what is allowed, whatever is thrown at it."""
import copy
import random
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
    ("load.pull_up.time={function=\"rampp\"}", ["time: function = \"rampp\"", 'did you mean "ramp"']),
    ("load.pull_up.time={function=\"ramp\"}", ["end is missing"]),
    ("body.plate.shape=bocks", ["shape = \"bocks\"", 'did you mean "box"']),
    ("material.glass.density=-1", ["material 'glass': density = -1", "above 0"]),
    ("material.glass.density=\"heavy\"", ['density = "heavy"', "a number"]),
    ("material.glass.density=true", ["density = true", "a number"]),
    ("material.glass.density=nan", ["density = nan", "finite"]),
    ("material.glass.density=1e400", ["density = inf", "finite"]),
    ("particles.influence=cubic", ['influence = "cubic"', '"gaussian"']),
    ("dimension=2d", ['dimension = "2d"', "plane_stress"]),
    ("material=3", ["material = 3", "a list"]),
    ("time=3", ["time = 3", "a table"]),
    ("time.dt=soon", ['dt = "soon"', '"auto"']),
    ("time.dt=0", ["dt = 0", "above 0"]),
    ("output.fields=[\"demage\"]", ['fields[0] = "demage"', 'did you mean "damage"']),
    ("output.frames=2.5", ["frames = 2.5", "whole number"]),
    ("body.plate.name=\"über\"", ["name", "a letter"]),
    ("title=1", ["title = 1", "text"]),
    ("model=gfem", ['model = "gfem"', '"particles"']),
    ("tip.crack.name=1", ["name = 1", "text"]),
    ("output.pictures=1", ["pictures = 1", "true or false"]),
])
def test_a_wrong_value_in_one_sentence(override, words):
    found = sentence(None, override)
    assert found.startswith("file.toml: ") and all(word in found for word in words), found


@pytest.mark.parametrize("text, words", [
    ("", ["dimension is missing"]),
    ("[[", ["not valid TOML", "key"]),
    ("a = 1\na = 2", ["not valid TOML"]),
    ("x = " + "[" * 5000, ["file.toml"]),
    ('dimension = "3d"\n[material]\nname = "a"', ["material = a table", "a list"]),
])
def test_broken_files(text, words):
    found = sentence(text)
    assert all(word in found for word in words), found


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "latin").write_bytes("title = 'Stra\xdfe'".encode("latin-1"))
    for path, words in ((tmp_path / "none.toml", "No such file"), (tmp_path, "directory"), (tmp_path / "latin", "not UTF-8"), ("a\0b", "cannot be read")):
        with pytest.raises(SceneError, match=words):
            read_scene(path)


def test_a_file_of_unreasonable_size(tmp_path):
    with open(tmp_path / "big.toml", "wb") as file:
        file.truncate(20_000_000)
    with pytest.raises(SceneError, match="20000000 bytes"):
        read_scene(tmp_path / "big.toml")


def test_overrides_reach_everything():
    changes = ["time.end=5e-6", "load.pull_up.value=[0.0, 1.0]", "load.1.value=[0, -1]", "title=Bare words", "damage.no_fail=[\"top\", \"bottom\", \"top_edge\", \"bottom_edge\"]",
               "output.every=1e-7", "body.plate.hole=[{shape=\"disk\", center=[0.08, 0.0], radius=0.002}]"]
    scene = parse_scene(GLASS.read_text(), "f", changes)
    assert scene.time.end == 5e-6 and scene.load[0].value == [0.0, 1.0] and scene.load[1].value == [0.0, -1.0] and scene.title == "Bare words"
    assert scene.body[0].hole[0].radius == 0.002


@pytest.mark.parametrize("override, words", [
    ("time.end", "section.key=value"), ("=3", "section.key=value"), ("nonsense.key=3", "not in the scene"), ("load.pul_up.value=[0,1]", "no entry pul_up"),
    ("load.7.value=[0,1]", "index below 2"), ("time.end.deep=1", "no table"), ("..=1", "section.key=value"),
])
def test_bad_overrides_say_where_they_come_from(override, words):
    found = sentence(None, override)
    assert found.startswith(f"--set {override}") and words in found


VALUES = [None, True, -1, 0, 3, 1e300, -1e-300, float("nan"), float("inf"), "", "all", "é\u202e\0", [], [1], [[]], {}, {"a": 1}, [{}], "x" * 10_000, 10**30, [0.0, "free"], ["top"]]


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
