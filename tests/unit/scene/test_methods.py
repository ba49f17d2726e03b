"""What scenes with finite elements and with regions of their own step fill in by themselves."""
from pathlib import Path

import pytest
from mpi4py import MPI

from pdhpc.scene.build import build
from pdhpc.scene.methods import ACTIVATION, TOLERANCE, Fem, Gfem
from pdhpc.scene.read import parse_scene, read_scene, scene_from_dict
from pdhpc.study.verify.case import plate
from tests.unit.scene.test_mesh_rules import FEM, GFEM

HERE = Path(__file__).resolve().parent


def test_tables_may_be_left_out():
    scene = parse_scene(GFEM, "a")
    assert scene.fem == Fem() and scene.gfem == Gfem() and scene.moduli == "lattice" and scene.safety == 0.75 and scene.uses_mesh and scene.uses_lattice
    scene = parse_scene(FEM, "a")
    assert scene.fem == Fem() and scene.gfem is None and scene.moduli == "continuum" and scene.safety == 0.9 and not scene.uses_lattice
    assert scene.pitch == 0.5 and scene.thickness == 1.0


def test_what_is_resolved_says_what_is_used():
    data = parse_scene(GFEM, "a", ["gfem.scheme=galerkin"]).resolved()
    assert data["gfem"]["activation"] == ACTIVATION and data["gfem"]["tolerance"] == TOLERANCE and data["fem"]["moduli"] == "lattice" and data["time"]["safety"] == 0.75
    data = parse_scene(GFEM, "a", ["gfem.everywhere=true"]).resolved()
    assert "activation" not in data["gfem"] and "tolerance" not in data["gfem"]
    assert "fem" not in parse_scene(FEM, "a", ["model=particles", "particles={spacing=0.5, horizon=1.5}"]).resolved()


@pytest.mark.parametrize("overrides, thickness", [([], 1.0), (["mesh.thickness=0.2"], 0.2), (["particles={spacing=0.5, horizon=1.5, thickness=0.3}"], 0.3)])
def test_thickness_stands_in_either_table(overrides, thickness):
    scene = parse_scene(FEM, "a", overrides)
    holder = scene.resolved()["particles" if scene.particles else "mesh"]
    assert scene.thickness == thickness == holder["thickness"]


def test_bodies_from_a_file():
    scene = read_scene(HERE / "everything_fem.toml")
    assert scene.from_file and scene.body[0].hole == () and scene.region[0].body is None and scene.pitch is None


@pytest.mark.parametrize("kinematics, safety", [("finite", 0.65), ("linear", 0.9)])
def test_the_resolved_share_of_the_critical_step_is_the_one_taken(kinematics, safety):
    """A resolved scene, read back, is the same run; so is a scene as it was given."""
    scene = parse_scene(plate((24, 16), kinematics=kinematics, extra='[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 3.0\nstep_ratio = 4\n'), "t")
    assert scene.safety == scene.resolved()["time"]["safety"] == safety
    steps = [build(each, MPI.COMM_SELF).dt for each in (scene, scene_from_dict(scene.resolved(), "t"), scene_from_dict(scene.given(), "t"))]
    assert steps[0] == steps[1] == steps[2]
    assert parse_scene(plate((24, 16), kinematics="finite"), "t").safety == 0.9, "one region needs no margin"
