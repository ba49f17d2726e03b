from pdhpc.scene.read import parse_scene
from pdhpc.study import coupled_estimate
from pdhpc.study.coupled_estimate import estimate_coupled

TEXT = """
model = "gfem"
dimension = "plane_stress"
[particles]
spacing = 0.005
horizon = 0.015
kinematics = "linear"
[mesh]
cell_size = 0.025
[[material]]
name = "glass"
density = 1.0
youngs_modulus = 1.0
critical_stretch = 0.02
[[body]]
name = "plate"
material = "glass"
shape = "box"
lower = [0.0, 0.0]
upper = [0.5, 0.4]
[[crack]]
type = "polyline"
points = [[-0.1, 0.2], [0.2, 0.2]]
[time]
end = 1.0
"""


def test_a_small_scene_is_built():
    found = estimate_coupled(parse_scene(TEXT, "scene"), 1)
    assert found.exact and (found.cells, found.vertices, found.ratio, found.particles) == (20 * 16, 21 * 17, 5, 20 * 16 * 25)
    # the crack ends on a line of vertices: bonds across it belong to particles up to a cell further, in one row of cells above and one below: 9 by 3 vertices
    assert found.patches in (27, 30) and found.active % 25 == 0
    assert 0.7 < found.dt / found.critical_dt <= 0.75 and found.dt / found.sub_steps <= 0.57 * found.particle_critical_dt


def test_a_large_one_takes_its_steps_from_a_sample(monkeypatch):
    built = estimate_coupled(parse_scene(TEXT, "scene"), 2)
    monkeypatch.setattr(coupled_estimate, "_SMALL", 0)
    found = estimate_coupled(parse_scene(TEXT, "scene"), 2)
    assert not found.exact and found.cells == built.cells and found.sub_steps == built.sub_steps
    assert abs(found.critical_dt / built.critical_dt - 1) < 0.01  # the same highest mode of the mesh, in a body of 12 x 12 cells
    assert abs(found.steps - built.steps) <= 1
