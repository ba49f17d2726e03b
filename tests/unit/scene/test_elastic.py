import math
from pathlib import Path

import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.elastic import build_elastic
from pdhpc.scene.gauges import make_gauges
from pdhpc.scene.read import parse_scene, read_scene
from pdhpc.scene.schema import SceneError
from tests.unit.scene.test_mesh_rules import FEM, SECOND

HELD = """
[[region]]
name = "left"
shape = "box"
lower = [0.0, 0.0]
upper = [0.1, 5.0]
[[region]]
name = "right"
shape = "half_space"
point = [9.9, 0.0]
normal = [1.0, 0.0]
[[load]]
name = "hold"
type = "displacement"
region = "left"
value = [0.0, "free"]
[[load]]
name = "pull"
type = "traction"
region = "right"
face = "+x"
value = [1e-3, 0.0]
"""
POINT = '[[region]]\nname = "corner"\nshape = "box"\nlower = [0.0, 0.0]\nupper = [0.1, 0.1]\n[[load]]\nname = "pin"\ntype = "displacement"\nregion = "corner"\nvalue = ["free", 0.0]\n'
GRIP = '[[probe]]\nname = "grip"\nregion = "left"\nquantity = "reaction"\n[[probe]]\nname = "end"\npoint = [10.0, 5.0]\nquantity = "displacement"\n'
ELASTIC = ["material.m.model=elastic", "material.m.poissons_ratio=0.3", "mesh.thickness=0.2"]
RUNS = Path(__file__).resolve().parents[3] / "runs"


def problem_of(comm, text, overrides=()):
    return build(parse_scene(text, "t", overrides), comm)


@pytest.mark.parametrize("basis", ("hat", "flat_top"))
def test_a_bar_in_equilibrium(comm, basis):
    """Uniaxial stress: u = sigma/E (x, -nu y), the support carries sigma A."""
    problem = problem_of(comm, FEM + HELD + POINT + GRIP, [*ELASTIC, "fem.integration=static", f"fem.partition_of_unity={basis}"])
    stepper = problem.stepper()
    _, probes, _ = make_gauges(problem, stepper.view, comm)
    stepper.advance()
    stepper.view.prepare()
    x = problem.body.mesh.points
    assert (stepper.step, stepper.time, problem.n_steps, problem.critical_dt) == (1, 1.0, 1, math.inf)
    assert np.allclose(stepper.view.field("displacement"), 1e-3 * x * [1.0, -0.3], atol=1e-12)
    assert np.allclose(stepper.view.field("stress"), [[1e-3, 0.0], [0.0, 0.0]], atol=1e-12)
    assert probes[0].read(stepper) == pytest.approx([-1e-3 * 5.0 * 0.2, 0.0], abs=1e-12) and probes[1].read(stepper) == pytest.approx([1e-2, -1.5e-3])
    work = problem.work(stepper, comm, 0.5)
    assert work["ksp_iterations"] > 0 and work["cell_steps_per_second_and_core"] == 400.0 and problem.sizes(stepper, comm)["dofs"] == 231 * (2 if basis == "hat" else 6)


def test_steps_of_each_integration(comm):
    explicit = problem_of(comm, FEM)
    speed = math.sqrt(1.125)  # of plane waves, nu = 1/3 in plane stress: sqrt(E/(1 - nu^2))
    assert 0.5 / speed / math.sqrt(2) < explicit.critical_dt <= 0.5 / speed * 1.001 and explicit.dt <= 0.9 * explicit.critical_dt
    with pytest.raises(SceneError, match="time.dt = 0.9 s; allowed is"):
        problem_of(comm, FEM, ["time.dt=0.9"])
    assert "above the critical step" in problem_of(comm, FEM, ["time.dt=0.9", "time.allow_unstable=true"]).warnings[0]
    newmark = problem_of(comm, FEM, ["fem.integration=newmark"])
    assert (newmark.dt, newmark.n_steps, newmark.critical_dt) == (0.01, 100, math.inf) and problem_of(comm, FEM, ["fem.integration=newmark", "time.dt=0.3"]).n_steps == 4


@pytest.mark.parametrize("integration", ("explicit", "newmark"))
def test_energy_comes_from_the_loads(comm, integration):
    problem = problem_of(comm, FEM + HELD, [f"fem.integration={integration}", "time.end=5.0", "time.dt=0.05"])
    stepper = problem.stepper()
    for _ in range(problem.n_steps):
        stepper.advance()
    ledger = {name: values.sum() for name, values in stepper.ledger().items()}
    assert ledger["external_work"] > 0 and ledger["kinetic_energy"] + ledger["strain_energy"] == pytest.approx(ledger["external_work"], rel=2e-3)
    force = stepper.view.field("force_density") * stepper.view.volume[:, None]
    assert force.shape == (231, 2) and np.isfinite(force).all()


@pytest.mark.parametrize("overrides, words", [
    (["load.hold.value=[\"free\", 0.0]"], ["load = prescribed displacements that leave 2 rigid motions", "hold the body"]),  # along x, and around the edge
    (["load=[]", "region=[]"], ["leave 3 rigid motions", "finds no equilibrium"]),
])
def test_a_body_that_nothing_holds_has_no_equilibrium(comm, overrides, words):
    with pytest.raises(SceneError) as caught:
        problem_of(comm, FEM + HELD, ["fem.integration=static", *overrides])
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize("lower, upper, words", [
    ([10.0, 5.0], [15.0, 10.0], "leave 1 rigid motion free of the piece at (10.25, 5.25) m, of the mesh's 2 pieces, each of cells that share edges; allowed is displacements that hold each"),
    ([12.0, 0.0], [15.0, 5.0], "leave 3 rigid motions free of the piece at (12.25, 0.25) m, of the mesh's 2 pieces"),
])
def test_each_piece_is_held(comm, lower, upper, words):
    """A second box that touches the first in a corner can turn, one that stands apart can move as it likes; neither is loaded."""
    text = FEM + HELD + SECOND.replace("[10.0, 0.0]", str(lower)).replace("[15.0, 5.0]", str(upper))
    overrides = ["load.hold.value=[0.0, 0.0]", "load.pull.value=[0.0, 0.0]"]
    with pytest.raises(SceneError) as caught:
        problem_of(comm, text, ["fem.integration=static", *overrides])
    assert words in str(caught.value), caught.value
    problem = problem_of(comm, text, ["fem.integration=newmark", *overrides])
    assert problem.sizes(problem.stepper(), comm)["pieces"] == 2


def test_probes_lie_in_the_mesh(comm, request):
    path = str(RUNS / "plate_with_hole_fe.toml")
    assert build_elastic(read_scene(path), comm).n_steps == 1
    with pytest.raises(SceneError, match="probe 'across': point = .*30 m from the nearest vertex; allowed is a point within a cell"):
        build_elastic(read_scene(path, ["probe.across.point=[50.0, 1.0]"]), comm)


def test_three_dimensions(comm):
    text = FEM.replace("plane_stress", "3d").replace("0.0, 0.0]", "0.0, 0.0, 0.0]").replace("10.0, 5.0]", "2.0, 1.0, 1.5]")
    text += '[[region]]\nname = "left"\nshape = "half_space"\npoint = [0.1, 0.0, 0.0]\nnormal = [-1.0, 0.0, 0.0]\n[[load]]\ntype = "displacement"\nregion = "left"\nvalue = [0.0, 0.0, 0.0]\n'
    text += '[[load]]\ntype = "gravity"\nvalue = [0.0, 0.0, -1.0]\n[[probe]]\nname = "grip"\nregion = "left"\nquantity = "reaction"\n'
    problem = problem_of(comm, text, ["fem.integration=static"])
    stepper = problem.stepper()
    stepper.advance()
    _, (probe,), _ = make_gauges(problem, stepper.view, comm)
    assert probe.read(stepper) == pytest.approx([0.0, 0.0, 3.0], abs=1e-9) and problem.body.mesh.kind == "hexahedron"
    explicit = problem_of(comm, text)
    stepper = explicit.stepper()
    stepper.advance()
    assert stepper.view.field("stress").shape == (60, 3, 3)
