import numpy as np
import pytest

from pdhpc.scene.mesh_body import body_of_cells, box_of, locking, make_mesh_body, moduli_of
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from tests.unit.scene.test_mesh_rules import FEM, SECOND

HOLE = 'body.b.hole=[{shape="disk", center=[5.0, 2.5], radius=1.1}]'
STIFF = '[[material]]\nname = "stiff"\nmodel = "elastic"\ndensity = 2.0\nbulk_modulus = 2.0\nshear_modulus = 1.2\n'
FILE = """
model = "fem"
dimension = "plane_stress"
[mesh]
file = "{file}"
[[material]]
name = "m"
model = "elastic"
density = 1.0
youngs_modulus = 1.0
poissons_ratio = 0.3
[[body]]
name = "plate"
material = "m"
shape = "mesh"
group = "plate"
[time]
end = 1.0
"""


def test_boxes_are_filled_with_cells(comm):
    scene = parse_scene(FEM + SECOND, "t", [HOLE])
    body = make_mesh_body(scene, comm)
    lower, upper, counts = box_of(scene)
    assert (lower.tolist(), upper.tolist(), counts.tolist()) == ([0.0, 0.0], [15.0, 5.0], [30, 10]) and body.partition is not None
    assert body.mesh.n_global_cells == 300 - 16 and body.number.max() == 1 and not body.kind.any()  # 16 cells of the hole: those with centres at (+-1/4 or 3/4)^2
    centres = body.mesh.points[body.mesh.cells].mean(axis=1)
    assert np.array_equal(body.number, (centres[:, 0] > 10.0).astype(int)) and np.array_equal(body_of_cells(scene, centres), body.number)
    assert body_of_cells(scene, np.array([[5.0, 2.5], [20.0, 1.0]])).tolist() == [-1, -1]


def test_moduli_are_those_of_each_material():
    scene = parse_scene(FEM + STIFF + SECOND.replace('"m"', '"stiff"'), "t", ["material.m.model=elastic", "material.m.poissons_ratio=0.25"])
    moduli, density = moduli_of(scene)
    assert density.tolist() == [1.0, 2.0]
    assert moduli[0] == pytest.approx(np.array([[1.0, 0.25, 0.0], [0.25, 1.0, 0.0], [0.0, 0.0, 0.375]]) / (1 - 0.0625))  # plane stress: E/(1 - nu^2) and E/(2 (1 + nu))
    assert moduli[1] == pytest.approx(moduli[0] * 3.0)  # K = 2, G = 1.2: E = 9 K G/(3 K + G) = 3, nu = 1/4
    assert moduli_of(parse_scene(FEM, "t"))[0][0][0, 1] == pytest.approx(3 / 8)  # pmb: nu = 1/3


def test_nearly_incompressible_solids_lock():
    """K = 1000 G: nu = (3 - 2/1000)/(2 (3 + 1/1000)) = 0.4995; plane stress does not lock, since it may grow thinner."""
    text, overrides = FEM + STIFF + SECOND.replace('"m"', '"stiff"'), ["material.m.model=elastic", "material.m.poissons_ratio=0.25"]
    assert locking(parse_scene(text, "t", [*overrides, "dimension=plane_strain"])) == []
    overrides += ["material.stiff.bulk_modulus=1000.0", "material.stiff.shear_modulus=1.0"]
    assert locking(parse_scene(text, "t", overrides)) == []
    said, = locking(parse_scene(text, "t", [*overrides, "dimension=plane_strain"]))
    assert "material 'stiff' lock at Poisson's ratio 0.4995" in said


@pytest.mark.parametrize("version", (2, 4))
def test_a_file_is_read_from_the_folder_of_the_scene(comm, request, version):
    folder = request.path.parents[1]
    scene = parse_scene(FILE.format(file=f"fem/quarter_plate_{version}.msh"), str(folder / "scene.toml"))
    body = make_mesh_body(scene, comm)
    assert body.mesh.kind in ("quad", "triangle") and body.partition is None and not body.number.any() and len(body.number) == len(body.mesh.cells) >= 4


@pytest.mark.parametrize("text, overrides, words", [
    (FILE, ['mesh.file="none.msh"'], ['mesh.file = "none.msh" (there is no mesh', "allowed is a file of one kind of cells"]),
    (FILE, ["body.plate.group=plat"], ["body 'plate': group = \"plat\"", "a group of cells of fem/quarter_plate_4.msh (lower half, plate) (did you mean \"plate\"?)"]),
    (FILE, ["dimension=3d"], ["with cells of 2 dimensions", 'cells of 3 with dimension = "3d"']),
    (FILE + '[[body]]\nname = "again"\nmaterial = "m"\nshape = "mesh"\ngroup = "plate"\n', [], ["body 'again': group", "with a body before it", "without common cells"]),
    (FEM, ["mesh.cell_size=1e-4"], ["mesh.cell_size = 0.0001 m, which makes 5e+09 cells", "at most 2.68e+08 on 1 ranks"]),
    (FEM, ['body.b.hole=[{shape="half_space", point=[0.0, 0.0], normal=[1.0, 0.0]}]'], ["body = the mesh has no cell", "not wholly a hole"]),
])
def test_what_only_the_mesh_shows(comm, request, text, overrides, words):
    with pytest.raises(SceneError) as caught:
        make_mesh_body(parse_scene(text.replace("{file}", "fem/quarter_plate_4.msh"), str(request.path.parents[1] / "s.toml"), overrides), comm)
    found = str(caught.value)
    assert all(word in found for word in words) and "\n" not in found, found
