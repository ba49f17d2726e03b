import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError

TABLE = 'shape = "table"\nfile = "points.txt"\n'
MESH = 'shape = "mesh"\nfile = "cells.msh"\n'
BOX = 'shape = "box"\nlower = [0.0, 0.0]\nupper = [8.0, 4.0]\n'
FINE = '[fine]\nshape = "disk"\ncenter = [9.0, 0.0]\nradius = 5.0\n'
GROUP = '[[region]]\nname = "r"\nshape = "group"\ngroup = "left"\n[[load]]\ntype = "displacement"\nregion = "r"\nvalue = [0.0, 0.0]\n'


def check(body=TABLE, extra="", *overrides, model="particles"):
    text = f"""
model = "{model}"
dimension = "plane_stress"
[particles]
spacing = 1.0
horizon = 3.0
[[material]]
name = "m"
density = 1.0
youngs_modulus = 1.0
[[body]]
name = "b"
material = "m"
{body}
[time]
end = 1.0
{extra}
"""
    return parse_scene(text, "f", overrides)


def test_what_is_right():
    assert check().brings_points and check(MESH, GROUP).brings_points and not check(BOX).brings_points
    assert check(TABLE + "block = -3\n").body[0].block == -3
    scene = check(BOX + "spacing = 0.5\n", "", "particles.volume_correction=none")
    assert scene.spacing_of(scene.body[0]) == 0.5
    for extra in ('[[crack]]\ntype = "polyline"\npoints = [[90.0, 0.0], [99.0, 0.0]]\n', '[[probe]]\nname = "p"\npoint = [99.0, 0.0]\nquantity = "velocity"\n',
                  FINE):
        check(TABLE, extra)  # only a file knows where its particles are


@pytest.mark.parametrize("body, extra, overrides, model, words", [
    ('shape = "mesh"\n', "", [], "particles", ["body 'b': file = nothing", "whose cells become particles"]),
    ('shape = "table"\n', "", [], "particles", ["file is missing"]),
    (TABLE + "spacing = 0.5\n", "", [], "particles", ["spacing is an unknown key"]),
    (TABLE + "block = 1.5\n", "", [], "particles", ["block = 1.5", "a whole number"]),
    (TABLE, "", ["particles.path=lattice"], "particles", ['particles.path = "lattice" with a body from a file', '"cloud"']),
    (BOX, GROUP, [], "particles", ["region 'r': shape = \"group\"", "a body from a file"]),
    (BOX + "spacing = 0.5\n", FINE, [], "particles", ["particles.volume_correction", "spacings of 0.5 m beside particles.spacing = 1 m", '"none"']),
    (BOX + "spacing = 2.0\n", "", ["particles.volume_correction=none"], "particles", ["particles.horizon = 3.0", "at least 2 spacings of every body, 4 m"]),
    (BOX + "spacing = 1.5\n", "", ["particles.volume_correction=none"], "particles", ["body 'b': upper", "8 m", "7.5 m"]),
    (TABLE, "[mesh]\ncell_size = 1.0\n", [], "fem", ["shape = \"table\"", '"box", or "mesh"']),
    (MESH, '[mesh]\nfile = "cells.msh"\n', [], "fem", ["body 'b': file", "mesh.file names the file"]),
    (BOX + "spacing = 0.5\n", "[mesh]\ncell_size = 1.0\n", [], "fem", ["body 'b': spacing"]),
    (TABLE, GROUP.replace("displacement", "traction"), [], "particles", ["face = nothing", "of finite elements needs none"]),
])
def test_each_rule_in_one_sentence(body, extra, overrides, model, words):
    with pytest.raises(SceneError) as caught:
        check(body, extra, *overrides, model=model)
    text = str(caught.value)
    assert "allowed" in text and all(word in text for word in words), text


def test_no_more_groups_than_bits():
    regions = "".join(f'[[region]]\nname = "r{k}"\nshape = "group"\ngroup = "g{k}"\n[[initial]]\nregion = "r{k}"\nvelocity = [1.0, 0.0]\n' for k in range(64))
    check(MESH, regions)
    with pytest.raises(SceneError, match="65 groups of cells.msh"):
        check(MESH + 'group = "all"\n', regions)
