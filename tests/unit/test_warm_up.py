import subprocess
import sys

import numba
import numpy as np
import pytest

from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting
from pdhpc.materials.state_based import LinearSolid
from pdhpc.study.verify.bodies import cracked, write_cells
from pdhpc.warm_up import MODELS, PATHS, Variant, block, compile_kernels, variant_of


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
def test_blocks(path, model):
    subdomain, law = block(3, 7, 3.0, path=path, model=model)
    assert subdomain.particles.n_owned == 343 and subdomain.bonds.family_size.max() == 122 and (subdomain.state is None) == (model == "pmb")
    assert hasattr(subdomain.bonds.arrays, "offset") == (path == "lattice")
    assert block(2, 5, 2.0, True, path, model)[0].particles.linear and np.isinf(law.critical_stretch).sum() == 0


def test_all_kernels_compile():
    compile_kernels()


WATCH = """
import sys
from numba.core.dispatcher import Dispatcher
from mpi4py import MPI
from pdhpc import simulation
from pdhpc.scene.read import read_scene
from pdhpc.scene.body import law_of
from pdhpc.warm_up import compile_coupling, compile_equilibrium, compile_interactions, compile_kernels, compile_points, variant_of

def compiled():
    found = set()
    for name, module in sys.modules.items():
        if name.startswith("pdhpc."):
            for each in vars(module).values():
                if isinstance(each, Dispatcher):
                    found.update((each.py_func.__module__, each.py_func.__qualname__, str(signature)) for signature in each.signatures)
    return found

path, model, scene, out = sys.argv[1:]
overrides = ["particles.path=" + path, "output.pictures=false"]
scene = read_scene(scene, overrides)
assert all(material.model == model for material in scene.material)
variant = variant_of(law_of(scene), scene.particles.surface_correction)
compile_kernels((scene.dim,), (path,), (model,), variant=variant)
if scene.stands_still:
    compile_equilibrium(scene.dim, path, model, scene.particles.kinematics == "linear", variant)
elif scene.fine is not None:
    compile_coupling(scene.dim, path, model, scene.particles.kinematics == "linear")
elif scene.contact is not None or scene.impactor:
    compile_interactions(scene.dim, path, model, MPI.COMM_SELF, True, variant)
if scene.brings_points:
    compile_points(scene.dim, MPI.COMM_SELF)
before = compiled()
simulation._compile_first_on_each_node = lambda *arguments: None
simulation.Simulation(scene, MPI.COMM_SELF).run(out, quiet=True)
assert len(before) > 10
for each in sorted(compiled() - before):
    print(*each)
"""


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("name, model, short", [("everything_2d.toml", "pmb", ("end = 1.0\n", "end = 1e-3\n")), ("everything_3d.toml", "lps", ("end = 1.0\n", "end = 5e-5\n")),
                                                ("everything_contact.toml", "pmb", ("end = 1.0\n", "end = 2e-3\n")), ("everything_static.toml", "pmb", ("steps = 4", "steps = 3"))])
def test_a_run_compiles_nothing_that_the_warm_up_left_out(path, name, model, short, tmp_path, request):
    """One process per node compiles; kernels it leaves out would be compiled by every rank."""
    text = (request.path.parent / "scene" / name).read_text()
    for old, new in (short, ("times = [0.5, 1.0]", "frames = 2"), ("history_every = 0.1\n", ""), ("every = 0.3", "frames = 1"), ("window = 0.05", "window = 1e-4")):
        text = text.replace(old, new)
    (tmp_path / name).write_text(text)
    command = [sys.executable, "-c", WATCH, path, model, str(tmp_path / name), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


OTHER = """
[[material]]
name = "other"
density = 1.0
youngs_modulus = 2.0
{keys}
[[body]]
name = "other"
material = "other"
shape = "box"
lower = [8.0, -4.0]
upper = [16.0, 4.0]
horizon = 2.5
[[initial]]
velocity_gradient = [[0.05, 0.0], [0.0, 0.02]]
[[crack]]
type = "polyline"
points = [[0.0, -9.0], [0.0, 0.0]]
"""


@pytest.mark.parametrize("model, keys, overrides", [
    ("pmb", "critical_stretch = 0.01\nstretch_softening = 0.25", ["particles.surface_correction=energy"]),
    ("pmb", 'energy_release_rate = 0.001\nfailure = "energy"', ["particles.surface_correction=volume"]),
    ("lps", 'model = "lps"\npoissons_ratio = 0.2\nenergy_release_rate = 0.001\nfailure = "energy"', []),
    ("pmb", "critical_stretch = 0.01\nstretch_softening = 0.25", ["contact"]),
])
def test_a_run_with_other_laws_and_horizons_compiles_nothing_more(model, keys, overrides, tmp_path):
    from pdhpc.study.verify.case import plate

    text = plate((16, 8), 2.0, kinematics="finite", material=keys, extra=OTHER.format(keys=keys))
    text += "[contact]\nfriction = 0.2\n" * overrides.count("contact")
    for override in overrides:
        key, value = override.split("=") if "=" in override else ("particles.path", "cloud")
        text = text.replace("[particles]", f'[particles]\n{key.split(".")[1]} = "{value}"')
    (tmp_path / "scene.toml").write_text(text.replace("end = 1.0", "end = 10.0"))
    done = subprocess.run([sys.executable, "-c", WATCH, "cloud", model, str(tmp_path / "scene.toml"), str(tmp_path / "out")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize("counts", [(12, 6), (6, 4, 4)])
def test_a_run_of_a_mesh_compiles_nothing_that_the_warm_up_left_out(counts, tmp_path):
    write_cells(tmp_path / "cells.inp", counts)
    traction = '[[load]]\ntype = "traction"\nregion = "right"\nface = "+x"\nvalue = {}\n'.format([1e-3] + [0.0] * (len(counts) - 1))
    (tmp_path / "scene.toml").write_text(cracked(counts, 'shape = "mesh"\nfile = "cells.inp"', 'shape = "group"\ngroup = "right"') + traction)
    command = [sys.executable, "-c", WATCH, "cloud", "pmb", str(tmp_path / "scene.toml"), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize("kind, moduli, model", [(BondBased, (2.0,), "pmb"), (LinearSolid, (2.0, 1.0), "lps")])
def test_what_is_compiled_for_strengths_that_scatter_is_what_a_scene_has(kind, moduli, model):
    material = kind("a", 1.0, *moduli, critical_stretch=0.1, weibull_modulus=5.0, weibull_seed=3, weibull_length=2.0)
    law = kind.law([(material, True), (material, False)], Setting("plane_stress", 2e-3, 1.0, "gaussian", 1e-3, "linear"))
    variant = variant_of(law, "none")
    assert variant == Variant(modulus=10.0)
    subdomain, compiled = block(2, 4, 2.0, model=model, variant=variant)
    assert numba.typeof(compiled) == numba.typeof(law) and len(subdomain.points.strength) == len(subdomain.points.position)
