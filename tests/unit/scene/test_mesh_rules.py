import pytest

from pdhpc.scene.mesh_rules import unused
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError

FEM = """
model = "fem"
dimension = "plane_stress"
[mesh]
cell_size = 0.5
[[material]]
name = "m"
density = 1.0
youngs_modulus = 1.0
[[body]]
name = "b"
material = "m"
shape = "box"
lower = [0.0, 0.0]
upper = [10.0, 5.0]
[time]
end = 1.0
"""
GFEM = FEM.replace('"fem"', '"gfem"') + '[particles]\nspacing = 0.1\nhorizon = 0.3\nkinematics = "linear"\n'
FILE = FEM.replace("cell_size = 0.5", 'file = "plate.msh"').replace('shape = "box"\nlower = [0.0, 0.0]\nupper = [10.0, 5.0]', 'shape = "mesh"')
PARTICLES = FEM.replace('"fem"', '"particles"').replace("[mesh]\ncell_size = 0.5", "[particles]\nspacing = 0.5\nhorizon = 1.5")
LATTICE = ["fem.moduli=lattice", 'particles={spacing=0.1, horizon=0.3}']
GROUP = '[[region]]\nname = "r"\nshape = "group"\ngroup = "left"\n'
TRACTION = '[[load]]\nname = "l"\ntype = "traction"\nregion = "r"\nvalue = [1.0, 0.0]\n'
CRACK = '[[crack]]\ntype = "polyline"\npoints = [[4.0, 2.5], [5.0, 2.5]]\n'
FINE = '[fine]\nshape = "box"\nlower = [1.0, 1.0]\nupper = [2.0, 2.0]\n'
SECOND = '[[body]]\nname = "c"\nmaterial = "m"\nshape = "box"\nlower = [10.0, 0.0]\nupper = [15.0, 5.0]\n'


@pytest.mark.parametrize("text, overrides", [
    (FEM, []), (GFEM, []), (FILE, []), (PARTICLES, []), (FEM, LATTICE), (FILE + GROUP + TRACTION, []), (FEM + SECOND, []),
    (FEM, ["material.m.model=elastic", "material.m.poissons_ratio=0.49"]), (FEM, ["material.m.model=lps", "material.m.poissons_ratio=0.2"]),
    (FEM, ["fem.integration=static", "fem.partition_of_unity=flat_top"]), (GFEM + CRACK, ["gfem.substeps=7", "time.safety=0.8"]), (GFEM, ["fem.moduli=continuum"]),
    (GFEM, ['body.b.hole=[{shape="box", lower=[1.0, 1.0], upper=[2.0, 1.5]}]']), (FEM, ['body.b.hole=[{shape="disk", center=[5.0, 2.5], radius=1.0}]']),
    (PARTICLES, ["mesh={cell_size=0.5}", "gfem={}"]),
])
def test_valid_scenes(text, overrides):
    scene = parse_scene(text, "f", overrides)
    assert parse_scene(text, "f", overrides).resolved() == scene.resolved()


@pytest.mark.parametrize("text, overrides, words", [
    (GFEM.split("[particles]")[0], [], ["particles = nothing", "one table headed [particles]", 'model = "gfem" needs it']),
    (PARTICLES.split("[particles]")[0] + "[[material]]" + PARTICLES.split("[[material]]")[1], [], ["particles = nothing", 'model = "particles" needs it']),
    (FEM, ["fem.moduli=lattice"], ['fem.moduli = "lattice" needs it']),
    (FEM.replace("[mesh]\ncell_size = 0.5", ""), [], ["mesh = nothing", 'model = "fem" needs it']),
    (FEM, ["mesh={thickness=1.0}"], ["mesh.cell_size = nothing, and no file", "exactly one"]),
    (FEM, ['mesh.file="a.msh"'], ['mesh.file = "a.msh" beside cell_size', "exactly one"]),
    (FEM, ["mesh.cell_size=-1"], ["mesh.cell_size = -1", "above 0"]),
    (FEM, ["mesh.thickness=1.0", "particles={spacing=0.5, horizon=1.5, thickness=0.3}"], ["beside particles.thickness", "not both"]),
    (FEM, ["mesh.cell_size=0.3"], ["body 'b': upper", "whole cells", "mesh.cell_size = 0.3"]),
    (FEM, ["body.b.shape=disk", "body.b.center=[0.0, 0.0]"], ["body 'b': lower is an unknown key"]),
    (FEM.replace('shape = "box"\nlower = [0.0, 0.0]\nupper = [10.0, 5.0]', 'shape = "disk"\ncenter = [0.0, 0.0]\nradius = 1.0'), [], ['shape = "disk"', '"mesh" with mesh.file']),
    (FEM.replace('shape = "box"\nlower = [0.0, 0.0]\nupper = [10.0, 5.0]', 'shape = "mesh"'), [], ['shape = "mesh"', "mesh.file"]),
    (FILE, ["body.b={name='b', material='m', shape='box', lower=[0.0, 0.0], upper=[1.0, 1.0]}"], []),
    (FILE + SECOND.replace('shape = "box"\nlower = [10.0, 0.0]\nupper = [15.0, 5.0]', 'shape = "mesh"\ngroup = "core"'), [], ["body 'b': group = nothing", "physical group"]),
    (FEM + GROUP + TRACTION, [], ["region 'r': shape", "mesh.file"]),
    (FEM + GROUP.replace("group", "box", 1).replace('group = "left"', "lower = [0.0, 0.0]\nupper = [1.0, 5.0]") + TRACTION, [], ["load 'l': face = nothing", '"+x"', "group"]),
    (FEM + SECOND, ["body.c.lower=[10.2, 0.0]", "body.c.upper=[15.2, 5.0]"], ["body 'c': lower", "whole cells away"]),
    (FEM + FINE, [], ["fine = a table", 'none with model = "fem"']),
    (FEM + CRACK, [], ["crack = one or more tables", 'model = "gfem" and "particles" do']),
    (FEM + '[[tip]]\nname = "t"\n', [], ["tip = one or more tables", "knows no cracks"]),
    (FEM, ["time.method=mts"], ['time.method = "mts" with model = "fem"', '"single"']),
    (FEM, ["fem.integration=implicit"], ['fem.integration = "implicit"', '"newmark"']),
    (FEM, ["fem.partition_of_unity=flat_top"], ['"flat_top" with integration = "explicit"', '"newmark" or "static"']),
    (FILE, ["fem.partition_of_unity=flat_top", "fem.integration=static"], ['"flat_top" with mesh.file']),
    (FILE, LATTICE, ['fem.moduli = "lattice" with mesh.file', "whole spacings"]),
    (FEM, [*LATTICE, "particles.spacing=0.15"], ["mesh.cell_size = 0.5", "whole multiple", "3.33333"]),
    (FEM, [*LATTICE, "material.m.model=lps"], ['"lps" with fem.moduli = "lattice"', '"continuum"']),
    (FEM, [*LATTICE, "material.m.model=elastic", "material.m.poissons_ratio=0.2"], ['model = "elastic"', '"pmb"']),
    (FEM, [*LATTICE, 'body.b.hole=[{shape="disk", center=[5.0, 2.5], radius=1.0}]'], ["hole[0]: shape = \"disk\"", "whole cells"]),
    (FEM, ["fem.integration=static", "time.dt=0.1"], ["time.dt = 0.1", "one step"]),
    (FEM + "[[initial]]\nvelocity = [1.0, 0.0]\n", ["fem.integration=static"], ["initial = 1 of them", "equilibrium"]),
    (FEM + TRACTION.replace("traction", "velocity").replace('"r"', '"all"'), ["fem.integration=static"], ["load 'l': type = \"velocity\"", '"displacement"']),
    (PARTICLES, ["material.m.model=elastic"], ['model = "elastic"', '"pmb" or "lps"']),
    (FEM, ["material.m.model=elastic"], ["poissons_ratio = nothing beside youngs_modulus", 'model = "elastic"']),
    (FEM, ["material.m.model=elastic", "material.m.poissons_ratio=0.2", "material.m.critical_stretch=0.1"], ["critical_stretch = 0.1", "never fails"]),
    (GFEM.replace("plane_stress", "3d"), [], ['dimension = "3d" with model = "gfem"', "two dimensions only"]),
    (GFEM, ['mesh={file="a.msh"}'], ['mesh.file = "a.msh" with model = "gfem"', "whole spacings"]),
    (GFEM + FINE, [], ["fine = a table", "gfem.substeps"]),
    (GFEM, ["fem.integration=newmark"], ['fem.integration = "newmark" with model = "gfem"', '"explicit"']),
    (GFEM, ["fem.partition_of_unity=flat_top"], ['"flat_top" with model = "gfem"', '"hat"']),
    (GFEM, ["particles.kinematics=finite"], ['particles.kinematics = "finite"', '"linear" with model = "gfem"']),
    (GFEM.replace('kinematics = "linear"\n', ""), [], ['particles.kinematics = "finite"', '"linear" with model = "gfem"']),
    (GFEM, ["material.m.model=lps"], ['model = "lps"', "collar of two horizons"]),
    (GFEM, ["gfem.tolerance=0.1"], ['gfem.tolerance = 0.1 with gfem.scheme = "pinned"', "no such key there"]),
    (GFEM, ["gfem.activation=0.5", "gfem.everywhere=true"], ["gfem.activation = 0.5 with gfem.everywhere = true"]),
    (GFEM, ["gfem.activation=1.0"], ["gfem.activation = 1.0", "below 1"]),
    (GFEM, ["gfem.substeps=0"], ["gfem.substeps = 0", '"auto"']),
    (GFEM, ["gfem.schema=pinned"], ["gfem.schema is an unknown key", 'did you mean "scheme"?']),
    (GFEM, ["time.safety=0.9"], ["time.safety = 0.9", "at most 0.8"]),
    (GFEM, ["mesh.cell_size=0.25"], ["mesh.cell_size = 0.25", "at least 4", "2.5"]),
    (GFEM, ["particles.horizon=0.5"], ["mesh.cell_size = 0.5", "horizon + spacing/2 = 0.55 m"]),
    (GFEM, ['body.b.hole=[{shape="box", lower=[1.0, 1.0], upper=[2.0, 1.3]}]'], ["hole[0]: upper", "whole cells"]),
])
def test_each_rule_in_one_sentence(text, overrides, words):
    with pytest.raises(SceneError) as caught:
        parse_scene(text, "f", overrides)
    found = str(caught.value)
    assert found.startswith(("f: ", "f with --set ")) and "; allowed i" in found and "\n" not in found and all(word in found for word in words), found


@pytest.mark.parametrize("text, overrides, words", [
    (FEM, [], []), (GFEM + CRACK, [], []), (PARTICLES, [], []),
    (PARTICLES, ["mesh={cell_size=0.5}", "gfem={}"], ["[mesh] is not used", "[gfem] is not used"]),
    (GFEM, ["model=fem", "gfem={}"], ["[gfem] is not used", "[particles] is not used"]),
    (FEM, ["particles={spacing=0.5, horizon=1.5, thickness=0.3}"], ["[particles] but for its thickness is not used"]),
    (FEM, ["material.m.critical_stretch=0.1", 'damage.no_fail=["all"]'], ["damage.no_fail is not used", "the strength of material 'm' is not used"]),
    (FEM, ["fem.integration=newmark", "time.safety=0.5"], ["time.safety is not used"]),
])
def test_what_a_model_leaves_unused(text, overrides, words):
    found = unused(parse_scene(text, "f", overrides))
    assert len(found) == len(words) and all(any(word in sentence for sentence in found) for word in words), found
