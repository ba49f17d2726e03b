"""Compile the kernels of runs with a mesh on small scenes, so that one process per node fills the cache before the others read it."""
import contextlib

import numpy as np

from pdhpc.fem.critical_step import critical_step
from pdhpc.fem.internal_forces import InternalForces, make_sweep
from pdhpc.fem.nodes import Nodes
from pdhpc.gfem.display import displayed
from pdhpc.parallel.comm import compile_exact_sum
from pdhpc.parallel.ghosts import compile_messages
from pdhpc.parallel.linear_solver import SolverError
from pdhpc.scene.build import build
from pdhpc.scene.gauges import make_gauges
from pdhpc.scene.read import parse_scene

MESH = """
model = "fem"
dimension = "{dimension}"
[particles]
spacing = 0.5
horizon = 1.0
[mesh]
cell_size = 1.0
[fem]
moduli = "{moduli}"
integration = "{integration}"
partition_of_unity = "{partition_of_unity}"
[[material]]
name = "m"
density = 1.0
youngs_modulus = 1.0
[[body]]
name = "b"
material = "m"
shape = "box"
lower = {lower}
upper = {upper}
[[region]]
name = "low"
shape = "half_space"
point = {near}
normal = {down}
[[region]]
name = "high"
shape = "half_space"
point = {far}
normal = {up}
[[load]]
type = "displacement"
region = "low"
value = {lower}
[[load]]
type = "gravity"
value = {up}
[[load]]
type = "traction"
region = "high"
face = "+x"
value = {up}
[time]
end = 1.0
"""


def compile_mesh(scene, comm):
    """Call every kernel of a run of finite elements once, on a small box; comm : of this process alone. Local."""
    zero, one = [0.0] * scene.dim, [1.0] + [0.0] * (scene.dim - 1)
    fem = scene.fem
    text = MESH.format(dimension=scene.dimension, integration=fem.integration, moduli=scene.moduli, partition_of_unity=fem.partition_of_unity, lower=zero,
                       upper=[4.0] * scene.dim, near=[0.1] + zero[1:], down=[-1.0] + zero[1:], far=[3.9] + zero[1:], up=one)
    problem = build(parse_scene(text, "warm-up"), comm)
    with contextlib.suppress(SolverError):  # whether the scene's own system is solved the run will see
        stepper = problem.stepper()
        stepper.advance()
        stepper.ledger()
        stepper.view.prepare()
        for name in ("stress", "strain", "force_density"):
            stepper.view.field(name)
    compile_exact_sum()
    if scene.from_file and scene.fem.integration == "explicit":
        nodes, stiffness = Nodes(problem.body.mesh, False), problem.elasticity.stiffness()
        nodes.set_mass(problem.elasticity.lumped_mass(nodes.stars))
        critical_step(problem.elasticity, stiffness, nodes, InternalForces(nodes, make_sweep(nodes, stiffness)))


COUPLED = """
model = "gfem"
dimension = "{dimension}"
[particles]
spacing = 0.2
horizon = 0.6
kinematics = "linear"
[mesh]
cell_size = 1.0
[gfem]
scheme = "{scheme}"
[[material]]
name = "m"
density = 1.0
youngs_modulus = 1.0
critical_stretch = 0.01
[[body]]
name = "b"
material = "m"
shape = "box"
lower = [0.0, 0.0]
upper = [8.0, 4.0]
[[region]]
name = "left"
shape = "box"
lower = [0.0, 0.0]
upper = [0.1, 4.0]
[[region]]
name = "top"
shape = "box"
lower = [0.0, 3.4]
upper = [8.0, 4.0]
[damage]
no_fail = ["top"]
[[crack]]
type = "polyline"
points = [[4.0, 1.0], [4.0, 2.0]]
[[load]]
type = "displacement"
region = "left"
value = [0.0, "free"]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.0, 0.01]
[[initial]]
velocity_gradient = [[0.01, 0.0], [0.0, 0.0]]
[[tip]]
name = "t"
window = 0.1
[time]
end = 1.0
"""


def compile_coupled(scene, comm):
    """Call every kernel of a run of finite elements with local particles once, on a small plate; comm : of this process alone. Local."""
    problem = build(parse_scene(COUPLED.format(dimension=scene.dimension, scheme=scene.gfem.scheme), "warm-up"), comm)
    stepper = problem.stepper()
    gauges = make_gauges(problem, stepper.view, comm)[2] + [problem.coupling(stepper, comm)]
    for _ in range(2):
        stepper.advance()
    stepper.local.look(1.0)
    stepper.local.wanting(1.0)
    stepper.ledger()
    stepper.view.prepare()
    stepper.view.first_not_finite()
    for name in ("displacement", "velocity", "damage", "stress", "strain", "force_density", "strain_energy_density"):
        stepper.view.field(name)
    for gauge in gauges:
        gauge.read(stepper)
    gauges[0].start(stepper)
    compile_messages(np.zeros((1, 2)), np.zeros((2, 1)).T, np.zeros((1, 2), np.int64))  # of vertices and cells, of positions by slot, of numbers
    if scene.output.pictures:
        displayed(comm, stepper)
