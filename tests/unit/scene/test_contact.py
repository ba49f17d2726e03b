"""What a table of contact or of an impactor refuses by itself."""
import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate

PLANE = '[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, -9.0]\nnormal = [0.0, 1.0]\n'
ROD = '[[impactor]]\nname = "r"\nshape = "cylinder"\ncenter = [0.0, 0.0, 9.0]\nradius = 1.0\naxis = [0.0, 1.0, 0.0]\n'


def read(extra, dimension="plane_stress"):
    cells = (6, 4, 4) if dimension == "3d" else (6, 4)
    return parse_scene(plate(cells, kinematics="finite", dimension=dimension, extra=extra), "f")


def test_defaults():
    scene = read(PLANE + "[contact]\n")
    contact, plane = scene.contact, scene.impactor[0]
    assert (contact.distance, contact.stiffness, contact.friction, contact.damping) == ("auto", "auto", 0.0, 0.0)
    assert plane.place == [0.0, -9.0] and plane.mass is None and plane.time is None
    assert read("").contact is None and read("").impactor == []
    assert read(ROD, "3d").impactor[0].length is None


@pytest.mark.parametrize("extra, words", [
    ('[[impactor]]\nname = "s"\nshape = "sphere"\ncenter = [0.0, 0.0]\nradius = 1.0\n', ["impactor 's': shape", '"cylinder" or "plane" in 2D']),
    (ROD.replace("[0.0, 0.0, 9.0]", "[0.0, 9.0]"), ["impactor 'r': axis", "across the plane"]),
    (PLANE.replace("[0.0, 1.0]", "[0.0, 0.0]"), ["normal", "not zero"]),
    (PLANE + "velocity = [1.0]\n", ["velocity", "2 components"]),
    (PLANE + "gravity = [0.0, 1.0]\n", ["gravity", "without a mass"]),
    (PLANE + "mass = 0.0\n", ["mass = 0.0", "above 0"]),
    (PLANE + 'mass = 1.0\ntime = { function = "ramp", end = 1.0 }\n', ["time", "with a mass"]),
    (PLANE + 'time = { function = "ramp", start = 2.0, end = 1.0 }\n', ["time.end", "after time.start"]),
    (PLANE + 'time = { function = "rampe", end = 1.0 }\n', ["rampe", 'did you mean "ramp"']),
    (PLANE.replace('"plane"', '"plain"'), ['shape = "plain"', 'did you mean "plane"']),
    (PLANE + "friction = -0.1\n", ["friction = -0.1", "at least 0"]),
    ("[contact]\nfrictoin = 0.1\n", ["contact.frictoin is an unknown key", 'did you mean "friction"']),
    ("[contact]\ndistance = 0\n", ["contact.distance", '"auto" or a number above 0']),
])
def test_what_is_refused(extra, words):
    with pytest.raises(SceneError) as error:
        read(extra)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_cylinder_needs_an_axis_in_space():
    with pytest.raises(SceneError, match="axis = nothing; allowed is a direction"):
        read(ROD.replace("axis = [0.0, 1.0, 0.0]\n", ""), "3d")
