"""The poster's example: a square of 4 x 4 cells and 20 x 20 particles, whose left corners are pulled apart until it splits along the middle (Schweitzer, Wu)."""
import math
from typing import NamedTuple

import numpy as np

from pdhpc.parallel.comm import largest, world
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.gfem import share
from pdhpc.study.verify.gfem_plate import coupled_problem
from pdhpc.study.verify.mts import field_by_id

_SOURCE = "prototype"
_CELL, _H, _K = 0.25, 0.05, 4
_END = 1.42  # s
_TEXT = """
dimension = "plane_stress"
[particles]
spacing = 0.05
horizon = 0.15075
kinematics = "linear"
[[material]]
name = "solid"
density = 1.0
youngs_modulus = 1.0
critical_stretch = {strength}
[[body]]
name = "square"
material = "solid"
shape = "box"
lower = [0.0, 0.0]
upper = [1.0, 1.0]
[[region]]
name = "above"
shape = "box"
lower = [0.0, 0.75]
upper = [0.25, 1.0]
[[region]]
name = "below"
shape = "box"
lower = [0.0, 0.0]
upper = [0.25, 0.25]
[[load]]
type = "force_density"
region = "above"
value = [0.0, {load}]
[[load]]
type = "force_density"
region = "below"
value = [0.0, -{load}]
[damage]
no_fail = ["above", "below"]
[time]
end = {end}
[output]
pictures = false
"""


class Split(NamedTuple):
    """What became of the square.

    error (n_steps,), relative L2, of the displacement after each step. broken bonds, and those of particles alone: reference. selected (25, 2) bool, enriched vertices, x slowest,
    by component, after the last step. counts [(x, y)] of displacements after each step. condition : of the mass matrix, largest of all steps. size : largest displacement, m.
    """

    error: np.ndarray
    broken: int
    reference: int
    selected: np.ndarray
    counts: list
    condition: float
    size: float


def _run(scheme, tolerance, load=0.1, strength=0.03, cells=()):
    """Return the Split of particles everywhere by a scheme against particles alone; a run that has blown up ends there. Collective."""
    comm, text = world(), _TEXT.format(load=load, strength=strength, end=_END)
    alone = build(parse_scene(text, "verification scene"), comm)
    alone.dt = 0.75 * math.sqrt(0.5) * alone.critical_dt
    dt = _K * alone.dt
    settings = ["model=gfem", "gfem.everywhere=true", f"gfem.scheme={scheme}", f"time.dt={dt!r}"]
    settings += [f"gfem.tolerance={tolerance}"] if tolerance is not None else []
    settings += ["time.allow_unstable=true"] if scheme == "instant" else []
    stepper, full = coupled_problem(text, _CELL, _K, settings).stepper(), alone.stepper()
    error, counts, condition, size = [], [], 1.0, 0.0
    for _ in range(int(round(_END / dt))):
        stepper.advance()
        for _ in range(_K):
            full.advance()
        stepper.view.prepare()
        u, expected = (field_by_id(each.view, each.view.field("displacement"), comm) for each in (stepper, full))
        error.append(float(np.linalg.norm(u - expected) / np.linalg.norm(expected)))
        size = float(np.abs(u).max())
        if not size < 1e3:
            break
        counts.append(tuple(comm.allreduce(np.asarray(stepper.scheme.enriched[0])).tolist()))
        condition = max(condition, stepper.scheme.mass.condition())
    return Split(np.array(error), comm.allreduce(stepper.broken) // 2, comm.allreduce(full.broken) // 2, _selected(stepper), counts, condition, size)


def _selected(stepper):
    """Return (25, 2) bool, the enriched functions by vertex and component, on every rank. Collective."""
    mesh, selected = stepper.solution.mesh, np.zeros((25, 2), int)
    mine = getattr(stepper.scheme.mass, "selected", None)
    if mine is not None:
        selected[mesh.vertex_id[: mesh.n_owned]] = mine[: mesh.n_owned]
    return world().allreduce(selected) > 0
