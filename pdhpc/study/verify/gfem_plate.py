"""The pre-cracked plate of the coupled method, and how a coupled run is held against particles everywhere, at the same sub-step on the same lattice."""
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pdhpc.parallel.comm import exact_sum, largest, world
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.mts import field_by_id

LENGTH, HEIGHT, CELL, CRACK = 1.0, 0.4, 0.025, 0.3  # of the plate; E = rho = 1
QUARTERS = ("T/4", "T/2", "3T/4", "T")
_CRACKED = 0.35  # damage grown since the start of what lies behind a tip

_BASE = """
model = "{model}"
dimension = "plane_stress"
[particles]
spacing = {h}
horizon = {horizon}
kinematics = "linear"
[[material]]
name = "glass"
density = 1.0
youngs_modulus = 1.0
{strength}
[[body]]
name = "plate"
material = "glass"
shape = "box"
lower = [0.0, 0.0]
upper = [{length}, {height}]
[time]
end = {end}
[output]
pictures = false
"""
_NOTCH = """
[[crack]]
type = "polyline"
points = [[-0.1, {middle}], [{crack}, {middle}]]
"""
_PULL = """
[[region]]
name = "top"
shape = "box"
lower = [0.0, {below}]
upper = [{length}, {height}]
[[region]]
name = "bottom"
shape = "box"
lower = [0.0, 0.0]
upper = [{length}, {layer}]
[damage]
no_fail = ["top", "bottom"]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.0, {load}]
[[load]]
type = "traction"
region = "bottom"
face = "-y"
value = [0.0, -{load}]
"""


class Plate(NamedTuple):
    """What a run of the plate is made of.

    ratio : H/h. k : sub-steps. end, s. load, Pa, on the upper and lower layer of cells, which never fail. strength : critical stretch; None never breaks.
    length, m. notched : whether the crack is there.
    """

    ratio: int = 5
    k: int = 4
    end: float = 1.5
    load: float = 0.0
    strength: object = None
    length: float = LENGTH
    notched: bool = True

    @property
    def spacing(self):
        """h, m."""
        return CELL / self.ratio

    def text(self, model):
        """Return the scene."""
        strength = f"critical_stretch = {self.strength}" if self.strength else ""
        text = _BASE.format(model=model, h=self.spacing, horizon=3.015 * self.spacing, strength=strength, length=self.length, height=HEIGHT, end=self.end)
        if self.notched:
            text += _NOTCH.format(middle=HEIGHT / 2, crack=CRACK)
        if self.load:
            text += _PULL.format(below=HEIGHT - CELL, layer=CELL, length=self.length, height=HEIGHT, load=self.load)
        return text

    def coupled(self, *settings):
        """Return the CoupledProblem on all ranks. Collective."""
        return coupled_problem(self.text("gfem"), CELL, self.k, settings)

    def full(self, dt):
        """Return the Problem of particles everywhere with steps of dt, s. Collective."""
        return build(parse_scene(self.text("particles"), "verification scene", [f"time.dt={dt!r}"]), world())


def coupled_problem(text, cell, k, settings=()):
    """Return the CoupledProblem of a scene text on all ranks. Collective."""
    return build(parse_scene(text, "verification scene", [f"mesh.cell_size={cell!r}", f"gfem.substeps={k}", *settings]), world())


class Result(NamedTuple):
    """What a run came to, of all ranks.

    u (4, n, 2), m, and energy (4,), J, of all particles as peridynamics has it, at the four quarters. tip (n_steps,), m, after each step. broken bonds;
    particle_steps : sub-steps of all particles that moved by themselves, 0 where all do.
    """

    u: np.ndarray
    energy: np.ndarray
    tip: np.ndarray
    broken: int
    particle_steps: int


def observe(stepper, n_steps, stride=1):
    """Return the Result of n_steps times `stride` steps. Collective."""
    comm, view = world(), stepper.view
    members, ahead = np.arange(view.n), np.ascontiguousarray(view.places()[:, 0])
    looks, u, energy, tip = {n_steps * quarter // 4 for quarter in (1, 2, 3, 4)}, [], [], []
    for step in range(1, n_steps + 1):
        for _ in range(stride):
            stepper.advance()
        foremost = view.foremost(members, ahead, _CRACKED)
        tip.append(max(CRACK, largest(comm, ahead[foremost] if foremost >= 0 else 0.0)))
        if step in looks:
            view.prepare()
            u.append(field_by_id(view, view.field("displacement"), comm))
            energy.append(energy_of(view))
    steps = comm.allreduce(stepper.local.particle_steps) if hasattr(stepper, "local") else 0
    return Result(np.array(u), np.array(energy), np.array(tip), comm.allreduce(stepper.broken) // 2, steps)


def energy_of(view):
    """Return the energy, J, that the particles have with the bonds among them: of a coupled body everywhere, patches or not. Collective."""
    view.prepare()
    kinetic = 0.5 * (view.field("velocity") ** 2).sum(axis=1)  # density 1
    return exact_sum(world(), view.volume * (kinetic + view.field("strain_energy_density")))


def run_coupled(plate, *settings):
    """Return (Result, dt) of a coupled run at its own step. Collective."""
    problem = plate.coupled(*settings)
    return observe(problem.stepper(), problem.n_steps), problem.dt


@lru_cache(maxsize=32)
def run_full(plate, dt, n_steps, halved=False):
    """Return the Result of particles everywhere over n_steps global steps of dt, s; halved : at half the sub-step. Collective."""
    stride = plate.k * (2 if halved else 1)
    return observe(plate.full(dt / stride).stepper(), n_steps, stride)


def errors(result, reference):
    """Return (4,), the relative L2 differences of displacements at the four quarters."""
    return np.linalg.norm(result.u - reference.u, axis=(1, 2)) / np.linalg.norm(reference.u, axis=(1, 2))


def words(values):
    """Return numbers as words."""
    return " ".join(f"{value:.3f}" for value in values)


def fit(field, length=LENGTH, spacing=CELL / 5):
    """Return function of points (n, 2) -> the bilinear finite-element field nearest to `field`, a function of points, in L2 on the particles."""
    tables, places = [], []
    for span in (length, HEIGHT):
        x = (np.arange(round(span / spacing)) + 0.5) * spacing
        places.append(x)
        tables.append(np.linalg.pinv(_hats(x, span)))
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    values = np.einsum("ap,bq,pqd->abd", *tables, field(grid.reshape(-1, 2)).reshape(grid.shape))
    return lambda x: values[tuple(np.rint(x / CELL).astype(int).T)]


def _hats(x, span):
    """Return (n, n_nodes), the piecewise linear functions of a line."""
    nodes = np.arange(round(span / CELL) + 1) * CELL
    return np.maximum(0.0, 1.0 - np.abs(x[:, None] - nodes) / CELL)


def set_in_motion(stepper, displacement, velocity, plate):
    """Give a coupled body functions of places (n, 2) as displacement and velocity: at the points of patches, elsewhere as elements carry them. Collective."""
    solution, particles = stepper.solution, stepper.local.subdomain.particles
    slots = stepper.local.points.slots
    for function, nodal, at_points in ((displacement, solution.displacement, particles.position), (velocity, solution.velocity, particles.velocity)):
        nodal[:] = fit(function, plate.length, plate.spacing)(solution.mesh.points)
        if len(slots):
            at_points[slots] = function(stepper.local.subdomain.places_at(slots))
    stepper.local.refresh()
    stepper.scheme.settle()
    solution.evaluate(stepper.time)
