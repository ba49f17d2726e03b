import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study import mesh_estimate
from pdhpc.study.mesh_estimate import estimate_mesh
from tests.unit.scene.test_elastic import HELD, POINT
from tests.unit.scene.test_mesh_rules import FEM


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(mesh_estimate, "_BLOCK", dict.fromkeys(mesh_estimate._BLOCK, 6))


@pytest.mark.parametrize("integration", ("explicit", "newmark", "static"))
def test_a_small_scene_is_built(comm, integration):
    scene = parse_scene(FEM + HELD + POINT, "t", [f"fem.integration={integration}", "material.m.critical_stretch=0.1"])
    found, problem = estimate_mesh(scene, 300), build(scene, comm)
    assert (found.exact, found.kind, found.cells, found.vertices, found.dofs, found.ranks) == (True, "quad", 200, 231, 462, 300)
    assert (found.critical_dt, found.dt, found.steps) == (problem.critical_dt, problem.dt, problem.n_steps)
    assert found.rate > 1e2 and 0 < found.memory < 1e4 and found.seconds > 0
    assert len(found.warnings) == 2 and "strength of material 'm' is not used" in found.warnings[0] and "some own nothing" in found.warnings[1]


def test_a_large_one_is_counted(monkeypatch, comm):
    monkeypatch.setattr(mesh_estimate, "_SMALL", 0)
    monkeypatch.setattr(mesh_estimate, "_SLAB", 40)  # 4 rows of cells at a time
    scene = parse_scene(FEM, "t", ['body.b.hole=[{shape="box", lower=[2.0, 1.0], upper=[4.0, 3.0]}]'])
    found, problem = estimate_mesh(scene, 1), build(scene, comm)
    assert not found.exact and found.cells == 200 - 16 and found.vertices == round(231 * 184 / 200)
    assert found.critical_dt == pytest.approx(problem.critical_dt, rel=0.02) and found.steps == problem.n_steps


def test_a_system_that_is_not_solved_has_a_cost(comm):
    from petsc4py import PETSc

    overrides = ["material.m.model=elastic", "material.m.poissons_ratio=0.49999", "dimension=plane_strain", "fem.integration=static"]
    PETSc.Options()["gfem_ksp_max_it"] = 1
    try:
        found = estimate_mesh(parse_scene(FEM + HELD + POINT, "t", overrides), 1)
    finally:
        PETSc.Options().delValue("gfem_ksp_max_it")
    assert 0.0 < found.seconds < 1e3 and "lock at Poisson's ratio 0.49999:" in found.warnings[-1]


def test_errors_are_those_of_a_run():
    with pytest.raises(SceneError, match="leave 3 rigid motions"):
        estimate_mesh(parse_scene(FEM, "t", ["fem.integration=static"]))
