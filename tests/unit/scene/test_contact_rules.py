import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate

PLANE = '[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, -9.0]\nnormal = [0.0, 1.0]\n'
FINE = '[fine]\nshape = "box"\nlower = [-1.0, -1.0]\nupper = [1.0, 1.0]\nstep_ratio = 2\n'
PROBE = '[[probe]]\nname = "{name}"\nregion = "all"\nquantity = "velocity"\n'
MESH = "[mesh]\ncell_size = 1.0\n"


@pytest.mark.parametrize("extra, kinematics, overrides, words", [
    ("[contact]\n", "linear", [], ['particles.kinematics = "linear" with contact', '"finite"']),
    (PLANE, "linear", [], ["with impactor", '"finite"']),
    ("[contact]\n" + FINE, "finite", [], ['time.method = "mts" with contact', '"single"']),
    ("[contact]\n", "finite", ["time.method=newton"], ['contact = a table with time.method = "newton"', "brought to rest"]),
    (PLANE, "linear", ["time.method=relaxation"], ['impactor = one or more tables with time.method = "relaxation"', "brought to rest"]),
    ("[contact]\ndistance = 3.1\n", "finite", [], ["contact.distance = 3.1", "up to the largest horizon, 3 m", "inside a whole body"]),
    (PLANE + MESH, "finite", ["model=fem"], ['impactor = one or more tables with model = "fem"', 'only model = "particles"']),
    ("[contact]\ndamping = 0.6\n", "finite", [], ["contact.damping = 0.6", "from 0 to 0.5"]),
    (PLANE + PLANE, "finite", [], ["impactor[1]: name", "no other impactor has"]),
    (PLANE + PROBE.format(name="p"), "finite", [], ["impactor 'p': name", "no probe or tip has"]),
    (PLANE + '[[curve]]\nname = "c"\nx = "p.position_y"\ny = "p.force_z"\n', "finite", [], ['y = "p.force_z"', "p.force_x", 'did you mean "p.force_']),
])
def test_what_is_refused(extra, kinematics, overrides, words):
    with pytest.raises(SceneError) as error:
        parse_scene(plate((6, 4), kinematics=kinematics, extra=extra), "f", overrides)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_what_is_allowed():
    parse_scene(plate((6, 4), kinematics="finite", extra="[contact]\ndistance = 3.0\n"), "f")
    parse_scene(plate((6, 4), kinematics="finite", extra="[contact]\n" + FINE), "f", ["time.method=single"])
    parse_scene(plate((6, 4), kinematics="finite", extra=PLANE + PROBE.format(name="q") + '[[curve]]\nname = "c"\nx = "p.position_y"\ny = "p.force_y"\n'), "f")
