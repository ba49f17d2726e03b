"""What a scene of finite elements enriched by particles would cost: built where it is small, estimated from a sample where it is large."""
import math
from typing import List, NamedTuple, Tuple

import numpy as np

from pdhpc.parallel.comm import world
from pdhpc.scene.body import make_body, radius_of
from pdhpc.scene.build import build
from pdhpc.scene.gauges import make_gauges
from pdhpc.scene.mesh_rules import unused
from pdhpc.scene.read import scene_from_dict
from pdhpc.study.estimate import critical_stretches, family_size, kernel_rate

_SMALL = 1e6  # particles up to which the body is built
_SAMPLE = 12  # cells per side of what the step of a large body is taken from
_BYTES_PER_PARTICLE = 113  # of the lattice, padding apart: fields 73, bond states 8 to 16, what the coupling knows by slot 24
_BYTES_PER_CELL = 900  # of the mesh, nodal fields, stiffnesses shared


class CoupledEstimate(NamedTuple):
    """Cost of a coupled scene on `ranks` ranks; `exact` when it was built.

    patches, active : vertices of J, and particles that move by themselves, at the start.
    """

    exact: bool
    cells: int
    vertices: int
    ratio: int
    particles: int
    critical_stretch: List[Tuple[str, str]]
    critical_dt: float
    dt: float
    steps: int
    sub_steps: int
    particle_critical_dt: float
    patches: int
    active: int
    ranks: int
    memory: float
    seconds: float
    warnings: List[str]


def estimate_coupled(scene, ranks=None):
    """Return the CoupledEstimate of a scene. Raises SceneError as a run would. Local to one process."""
    from mpi4py import MPI

    ranks, size = ranks or world().size, scene.mesh.cell_size
    body, ratio = make_body(scene), round(size / scene.particles.spacing)
    particles = sum(int(np.prod(lattice.cells, dtype=object)) for lattice in body.lattices)
    exact = particles <= _SMALL
    problem = build(scene if exact else _sample_of(scene), MPI.COMM_SELF)
    stepper, mesh = problem.stepper(), problem.coupled_parts.mesh
    warnings = unused(scene) + problem.warnings
    if exact:
        make_gauges(problem, stepper.view, MPI.COMM_SELF)
        particles, cells, vertices = stepper.view.n, mesh.n_global_cells, mesh.n_global_vertices
        patches, active = int(stepper.patches.chosen.sum()), stepper.local.n_active
        steps = problem.n_steps
        warnings += [f"{ranks} ranks for {cells} cells: some own nothing"] if ranks > cells else []
    else:
        cells = particles // ratio**2
        vertices, steps = cells, max(1, math.ceil(scene.time.end / problem.dt))
        length = sum(np.linalg.norm(np.diff(np.array(crack.points, float), axis=0), axis=1).sum() for crack in scene.crack)
        patches = vertices if scene.gfem.everywhere else math.ceil(3 * length / size)
        active = particles if scene.gfem.everywhere else min(particles, math.ceil(4 * length / size) * ratio**2)
    memory = (particles * _BYTES_PER_PARTICLE + cells * _BYTES_PER_CELL) / ranks
    bonds = active * family_size(scene.dim, radius_of(scene) / scene.particles.spacing)
    seconds = steps * (1.5 * (problem.k + 1) * bonds / kernel_rate(scene, radius_of(scene) / scene.particles.spacing, "lattice", body.law) / ranks + 1e-3)
    return CoupledEstimate(exact, cells, vertices, ratio, particles, critical_stretches(scene, body), problem.critical_dt, problem.dt, steps, problem.k,
                           problem.parts[0].critical_dt, patches, active, ranks, memory, seconds, warnings)


def _sample_of(scene):
    """Return a scene of the same materials and cells, with small bodies and nothing that happens to them: where its steps are taken from."""
    data, most = scene.resolved(), _SAMPLE * scene.mesh.cell_size
    for group in ("region", "crack", "load", "initial", "probe", "curve", "tip"):
        data.pop(group, None)
    data["damage"] = {"no_fail": []}
    for number, table in enumerate(data["body"]):
        table["hole"] = []
        shift = 2 * number * most
        table["lower"], table["upper"] = [shift, 0.0], [shift + most, most]
    return scene_from_dict(data, scene.source)
