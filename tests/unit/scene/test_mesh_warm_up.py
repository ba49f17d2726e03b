"""One process per node compiles; kernels that it leaves out would be compiled by every rank."""
import subprocess
import sys

import pytest

from pdhpc.gfem.schemes import NAMES
from tests.unit.scene.test_elastic import GRIP, HELD, POINT
from tests.unit.scene.test_mesh_rules import CRACK, FEM, GFEM, LATTICE

WATCH = """
import sys
from numba.core.dispatcher import Dispatcher
from mpi4py import MPI
from pdhpc import simulation
from pdhpc.scene.read import read_scene
from pdhpc.warm_up import compile_scene

def compiled():
    found = set()
    for name, module in sys.modules.items():
        if name.startswith("pdhpc."):
            for each in vars(module).values():
                if isinstance(each, Dispatcher):
                    found.update((each.py_func.__module__, each.py_func.__qualname__, str(signature)) for signature in each.signatures)
    return found

scene = read_scene(sys.argv[1], ["output.pictures=false", *sys.argv[3:]])
compile_scene(scene, MPI.COMM_SELF)
before = compiled()
simulation._compile_first_on_each_node = lambda *arguments: None
simulation.Simulation(scene, MPI.COMM_SELF).run(sys.argv[2], quiet=True)
assert len(before) > 5
for each in sorted(compiled() - before):
    print(*each)
"""
FIELDS = 'output.fields=["displacement", "velocity", "damage", "precrack", "stress", "strain", "strain_energy_density", "force_density"]'
FORCE = '[[load]]\ntype = "force_density"\nregion = "right"\nvalue = [0.0, 1e-3]\n'


def left_out(folder, text, *overrides):
    """Return what a run of a scene compiles beyond its warm-up."""
    (folder / "s.toml").write_text(text)
    done = subprocess.run([sys.executable, "-c", WATCH, str(folder / "s.toml"), str(folder / "out"), "output.frames=1", FIELDS, *overrides], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("overrides", [["fem.integration=explicit"], ["fem.integration=newmark"], ["fem.integration=static", "fem.partition_of_unity=flat_top"], LATTICE])
def test_a_mesh_compiles_nothing_that_the_warm_up_left_out(tmp_path, overrides):
    assert left_out(tmp_path, FEM + HELD + POINT + GRIP + FORCE, *overrides) == ""


@pytest.mark.parametrize("scheme", NAMES)
def test_a_coupled_run_compiles_nothing_that_the_warm_up_left_out(tmp_path, scheme):
    """The comparators are stable at smaller steps only. What is written for pictures counts too."""
    overrides = f"gfem.scheme={scheme}", "material.m.critical_stretch=0.01", "time.safety=0.1", "output.pictures=true"
    assert left_out(tmp_path, GFEM + HELD + GRIP + FORCE + CRACK, *overrides) == ""
