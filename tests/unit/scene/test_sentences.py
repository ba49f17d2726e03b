import pytest
from pydantic import ValidationError

from pdhpc.scene.schema import Scene
from pdhpc.scene.sentences import listed, nearest, sentence, where

MATERIAL = {"name": "m", "density": 1.0, "youngs_modulus": 1.0}
BOX = {"name": "b", "material": "m", "shape": "box", "lower": [0, 0], "upper": [1, 1]}
GOOD = {"dimension": "plane_stress", "particles": {"spacing": 1.0, "horizon": 3.0}, "material": [MATERIAL], "body": [BOX], "time": {"end": 1.0}}


def say(**changes):
    """Return the sentence for GOOD with keys of the top level changed, or left out when None."""
    data = {key: value for key, value in {**GOOD, **changes}.items() if value is not None}
    with pytest.raises(ValidationError) as caught:
        Scene.model_validate(data)
    return sentence(data, caught.value.errors())[1]


def test_good_is_good():
    Scene.model_validate(GOOD)


@pytest.mark.parametrize("changes, expected", [
    ({"particles": {"spacng": 1.0, "horizon": 3.0}},  # also makes spacing missing
     'particles.spacng is an unknown key; allowed in particles is spacing, horizon, thickness, influence, volume_correction, surface_correction, kinematics, path (did you mean "spacing"?)'),
    ({"particles": {"spacing": 1.0, "horizon": 3.0, "density": 1.0}}, '("density" belongs to [[material]])'),
    ({"horizon": 1.0}, 'horizon is an unknown key; allowed in the top level is title, model, dimension'),
    ({"horizon": 1.0}, '("horizon" belongs to [particles] and [[body]])'),
    ({"materials": [MATERIAL], "material": None}, '(did you mean "material"?)'),
    ({"material": [{**MATERIAL, "rho\n": 1}]}, "material 'm': \"rho\\n\" is an unknown key"),
    ({"dimension": None}, 'dimension is missing; allowed is "plane_stress", "plane_strain", "3d"'),
    ({"time": None}, "time is missing; allowed is one table headed [time]"),
    ({"material": None}, "material is missing; allowed is one or more tables headed [[material]]"),
    ({"time": {}}, "time.end is missing; allowed is a value: end of the run, s"),
    ({"material": MATERIAL}, "material = a single table [material]; allowed is one or more tables headed [[material]]"),
    ({"material": 3}, "material = 3; allowed is one or more tables headed [[material]]"),
    ({"material": []}, "material = []; allowed is one or more tables headed [[material]]"),
    ({"material": [3]}, "material[0] = 3; allowed is a table headed [[material]]"),
    ({"particles": [{"spacing": 1.0}]}, "particles = a list of tables; allowed is one table headed [particles]"),
    ({"particles": 3}, "particles = 3; allowed is one table headed [particles]"),
    ({"body": [{**BOX, "hole": {}}]}, "body 'b': hole = a single table; allowed is one or more tables headed [[body.hole]]"),
    ({"body": [{**BOX, "hole": [1]}]}, "body 'b': hole[0] = 1; allowed is a table headed [[body.hole]]"),
    ({"body": [{**BOX, "hole": [{"shape": "dsk"}]}]}, "body 'b': hole[0]: shape = \"dsk\"; allowed is \"box\", \"disk\""),
    ({"body": [{**BOX, "shape": "boks"}]}, "body 'b': shape = \"boks\"; allowed is \"box\", \"disk\", \"sphere\", \"cylinder\", \"mesh\", \"table\" (did you mean \"box\"?)"),
    ({"body": [{**BOX, "shape": ["box"]}]}, "body 'b': shape = [\"box\"]; allowed is"),
    ({"body": [{"name": "b", "material": "m"}]}, "body 'b': shape is missing; allowed is \"box\""),
    ({"body": [{"name": "b", "shap": "box"}]}, "body 'b': shap is an unknown key"),  # not: shape is missing
    ({"body": [{"name": "b", "shap": "box"}]}, '(did you mean "shape"?)'),
    ({"body": [3]}, "body[0] = 3; allowed is a table headed [[body]]"),
    ({"body": [{**BOX, "radius": 1.0}]}, "body 'b': radius is an unknown key; allowed in body 'b' is name, material, horizon, spacing, hole, shape, lower, upper"),
    ({"body": [{**BOX, "lower": [0, "0"]}]}, "body 'b': lower[1] = \"0\"; allowed is a number"),
    ({"body": [{**BOX, "lower": 0}]}, "body 'b': lower = 0; allowed is a list of numbers such as [0.0, 1.0]"),
    ({"load": [{"type": "gravity", "value": [0, 1], "time": 3}]}, "load[0]: time = 3; allowed is a table in { }"),
    ({"load": [{"type": "gravity", "value": [0, 1], "time": {"function": "rampe"}}]}, "load[0]: time.function = \"rampe\"; allowed is"),
    ({"output": {"fields": ["damage", "stres"]}}, "output.fields[1] = \"stres\"; allowed is"),
    ({"output": {"fields": ["damage", "stres"]}}, '(did you mean "stress"?)'),
    ({"model": "gfme"}, 'model = "gfme"; allowed is "particles", "fem", "gfem" (did you mean "gfem"?)'),
    ({"model": 3}, 'model = 3; allowed is "particles", "fem", "gfem"'),
    ({"model": "fem", "fem": 3}, 'fem = 3; allowed is one table headed [fem]'),
    ({"model": "fem", "mesh": {"cell_sise": 1.0}}, 'mesh.cell_sise is an unknown key; allowed in mesh is cell_size, file, thickness (did you mean "cell_size"?)'),
    ({"gfem": {"scheme": "pined"}}, '(did you mean "pinned"?)'),
    ({"dimension": "3D"}, 'dimension = "3D"; allowed is "plane_stress", "plane_strain", "3d" (did you mean "3d"?)'),
])
def test_sentences(changes, expected):
    assert expected in say(**changes)


def test_an_unknown_key_comes_first_and_a_missing_one_last():
    assert "particles.x is" in say(particles={"spacing": "a", "x": 1}, time=None)
    assert 'particles.spacing = "a"' in say(particles={"spacing": "a"}, time=None)


def test_paths_as_words():
    data = {"load": [{"name": "pull", "value": [0, 1]}, {"time": {"end": 1}}, {"name": "a\nb"}]}
    assert where(data, ("load", 0, "value", 1)) == "load 'pull': value[1]"
    assert where(data, ("load", 1, "time", "end")) == "load[1]: time.end"
    assert where(data, ("load", 2)) == "load[2]"
    assert where({}, ()) == ""


def test_nearest_and_listed():
    assert nearest("horizn", ["spacing", "horizon"]) == ' (did you mean "horizon"?)' and nearest("x", ["spacing"]) == "" == nearest(10**5000, ["a"])
    assert listed("abc") == "a, b, c" and listed([str(n) for n in range(20)]).endswith("15 and 4 more")
