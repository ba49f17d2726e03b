"""The poster's example (Schweitzer, Wu): a square of 4 x 4 cells and 20 x 20 particles, whose left corners are pulled apart until it splits in the middle."""
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.parallel.comm import world
from pdhpc.scene.build import build
from pdhpc.scene.read import read_scene
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.gfem import share
from pdhpc.study.verify.mts import field_by_id

SCENE = Path(__file__).resolve().parents[3] / "runs" / "poster_splitting.toml"
_SOURCE = "prototype"
_TWENTY, _LARGE = (20, 5, 0.09), (10, 4, 0.17)  # number of steps, sub-steps and step, s: the scene's own; 0.69 of the critical one of the lumped mesh


class Split(NamedTuple):
    """What became of the square.

    error (n_steps,), relative L2, of the displacement after each step. broken bonds, and those of particles alone: reference. counts [(x, y)], functions that
    enrich the displacement in each step. condition : of the mass matrix, largest of all steps. size : largest displacement, m. stepper, as it is at the end.
    """

    error: np.ndarray
    broken: int
    reference: int
    counts: list
    condition: float
    size: float
    stepper: object


def split(scheme, tolerance, steps):
    """Return the Split of the scene that ships, by another scheme, tolerance and steps, against particles alone; a run that has blown up ends there. Collective.

    steps : number of steps, sub-steps k, and step, s.
    """
    comm, (n_steps, k, dt) = world(), steps
    common = [f"time.end={n_steps * dt!r}", f"output.every={n_steps * dt!r}", "output.pictures=false"]
    coupled = [f"gfem.scheme={scheme}", f"gfem.tolerance={tolerance}", f"gfem.substeps={k}", f"time.dt={dt!r}"]
    coupled += ["time.allow_unstable=true"] if scheme == "instant" else []
    stepper = build(read_scene(str(SCENE), common + coupled), comm).stepper()
    full = build(read_scene(str(SCENE), [*common, "model=particles", f"time.dt={dt / k!r}"]), comm).stepper()
    error, counts, condition, size = [], [], 1.0, 0.0
    while len(error) < n_steps and size < 1e3:
        stepper.advance()
        for _ in range(k):
            full.advance()
        stepper.view.prepare()
        u, expected = (field_by_id(each.view, each.view.field("displacement"), comm) for each in (stepper, full))
        error.append(float(np.linalg.norm(u - expected) / np.linalg.norm(expected)))
        size = float(np.abs(u).max())
        counts.append(tuple(comm.allreduce(np.asarray(stepper.scheme.enriched[0])).tolist()))
        condition = max(condition, stepper.scheme.mass.condition() if size < 1.0 else 1.0)
    return Split(np.array(error), comm.allreduce(stepper.broken) // 2, comm.allreduce(full.broken) // 2, counts, condition, size, stepper)


def enriched_by_displacement(stepper, tolerance):
    """Return (25, 2) bool, x slowest: the vertices whose patches the displacement itself enriches, by component, on every rank. Collective."""
    mesh, space, particles = stepper.solution.mesh, stepper.scheme.mass, stepper.local.subdomain.particles
    space.select(np.ascontiguousarray(particles.position[stepper.local.points.slots]), tolerance)
    selected = np.zeros((25, 2), int)
    selected[mesh.vertex_id[: mesh.n_owned]] = space.selected[: mesh.n_owned]
    return world().allreduce(selected) > 0


@case
def gfem_poster():
    """The poster's square at k = 4: errors against particles alone with and without a tolerance, and the mass matrix"""
    checks = []
    for tolerance, bound in ((0.05, 0.2), (0.0, 1e-6)):
        found = split("galerkin", tolerance, _LARGE)
        counts = f"functions in x, y by step {', '.join(f'{x}+{y}' for x, y in found.counts)}; {found.broken} bonds break, {found.reference} of particles alone"
        checks.append(at_most(f"tolerance {tolerance}: largest error after the second step ({counts})", found.error[2:].max(), bound, _SOURCE))
        what = f"tolerance {tolerance}: condition number of the scaled, centred mass matrix {found.condition:.0f}, less than 1000"
        checks.append(share(1.0 < found.condition < 1e3, what))
        checks.append(share(found.reference > 300, "bonds break", "a case that tests something"))
    return checks


@case
def gfem_poster_functions():
    """The poster's square in 20 steps of 5: which vertices its displacement enriches at tolerance 0.05"""
    found = split("galerkin", 0.05, _TWENTY)
    chosen = enriched_by_displacement(found.stepper, 0.05)
    by_place = chosen.reshape(5, 5, 2)
    x, y = chosen.sum(axis=0)
    spared = not by_place[-1].any() and not by_place[:, [0, -1]].any()
    counts = ", ".join(f"{a}+{b}" for a, b in found.counts[-3:])
    return [
        Check("vertices enriched in x", x, 9, 0.0, _SOURCE),
        Check("vertices enriched in y", y, 10, 1.0, _SOURCE, relative=False),
        share(spared, "the right column and the outer rows stay standard"),
        at_most(f"error of the displacement at the end (functions that enriched the last increments: {counts})", found.error[-1], 0.2, _SOURCE),
    ]


@case
def gfem_instant():
    """The force of the step's end in the place of its mean, k = 4, must blow up where the mean does not"""
    wrong, right = split("instant", 0.05, _LARGE), split("galerkin", 0.05, _LARGE)
    return [
        share(not wrong.error[-1] < 10.0, f"control, instant: error {wrong.error[-1]:.1e} after {len(wrong.error)} steps exceeds 10"),
        at_most("galerkin, the same steps", right.error[-1], 0.2, _SOURCE),
    ]
