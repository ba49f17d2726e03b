"""What a scene of finite elements would cost: counted and built where it is small, estimated from a sample where it is large."""
import contextlib
import math
import time
from typing import List, NamedTuple, Optional

import numpy as np

from pdhpc.fem.elements import ELEMENTS
from pdhpc.parallel.comm import world
from pdhpc.parallel.linear_solver import SolverError, start_petsc
from pdhpc.scene.build import build
from pdhpc.scene.gauges import make_gauges
from pdhpc.scene.mesh_body import body_of_cells, box_of, locking
from pdhpc.scene.mesh_rules import unused
from pdhpc.scene.read import scene_from_dict
from pdhpc.scene.steps import choose_step

_SMALL = 500_000  # cells up to which the mesh is built
_SLAB = 1 << 18  # centres looked at together
_BYTES_PER_CELL = {"triangle": 210, "quad": 210, "tetra": 320, "hexahedron": 320}  # of the mesh itself
_BYTES_PER_ENTRY = 32  # of an assembled matrix: block values, PETSc's copy with columns, coarser levels of multigrid
_NEIGHBOURS = {"triangle": 7, "quad": 9, "tetra": 15, "hexahedron": 27}  # of a vertex, itself included
_BLOCK = {("explicit", 2): 200, ("explicit", 3): 30, ("implicit", 2): 60, ("implicit", 3): 12}  # cells per side of what speed is measured on


class MeshEstimate(NamedTuple):
    """Cost of a scene on `ranks` ranks; `exact` when the mesh was built."""

    exact: bool
    kind: str
    cells: int
    pieces: Optional[int]  # None where the mesh was not built
    vertices: int
    dofs: int
    integration: str
    moduli: str
    critical_dt: float  # s; infinite for implicit integration
    dt: float
    steps: int
    ranks: int
    memory: float  # bytes per rank
    rate: float  # cells per second and core
    seconds: float
    warnings: List[str]


def estimate_mesh(scene, ranks=None):
    """Return the MeshEstimate of a scene of finite elements. Raises SceneError as a run would. Local to one process."""
    start_petsc()
    ranks = ranks or world().size
    exact = scene.from_file or float(np.prod(box_of(scene)[2], dtype=float)) <= _SMALL
    if exact:
        from mpi4py import MPI

        problem = build(scene, MPI.COMM_SELF)
        mesh, kind = problem.body.mesh, problem.body.mesh.kind
        make_gauges(problem, problem.stepper().view, MPI.COMM_SELF)
        pieces, cells, vertices, width = problem.pieces.count, mesh.n_global_cells, mesh.n_global_vertices, problem.elasticity.width
        critical, dt, steps, warnings = problem.critical_dt, problem.dt, problem.n_steps, list(problem.warnings)
        if ranks > cells:
            warnings.append(f"{ranks} ranks for {cells} cells: some own nothing")
    else:
        kind, block = {2: "quad", 3: "hexahedron"}[scene.dim], _problem(scene, 4)
        pieces, (cells, vertices) = None, _count(scene)
        width, critical = block.elasticity.width, block.critical_dt
        dt, steps, warnings = choose_step(scene, critical) if scene.fem.integration == "explicit" else (block.dt, block.n_steps, [])
        warnings = warnings + locking(scene)
    rate = _rate(scene)
    memory = _memory(scene, kind, cells, vertices, width) / ranks
    seconds = cells * steps / (rate * ranks)
    return MeshEstimate(exact, kind, cells, pieces, vertices, vertices * width, scene.fem.integration, scene.moduli, critical, dt, steps, ranks, memory, rate, seconds,
                        unused(scene) + warnings)


def _count(scene):
    """Return (cells, vertices about) of boxes, slab by slab."""
    lower, upper, counts = box_of(scene)
    axes = [low + (np.arange(count) + 0.5) * (high - low) / count for low, high, count in zip(lower, upper, counts)]
    per_slab, cells = max(1, _SLAB // int(np.prod(counts[1:]))), 0
    for first in range(0, int(counts[0]), per_slab):
        grid = np.meshgrid(axes[0][first : first + per_slab], *axes[1:], indexing="ij")
        cells += int(np.count_nonzero(body_of_cells(scene, np.stack([each.ravel() for each in grid], axis=1)) >= 0))
    whole = int(np.prod(counts, dtype=object))
    return cells, round(int(np.prod(counts + 1, dtype=object)) * cells / whole)


def _problem(scene, cells):
    """Return the ElasticProblem of a cube of `cells` per side of the scene's cells and stiffest material, held at one end, pulled by its weight."""
    from mpi4py import MPI

    data, dim = scene.resolved(), scene.dim
    size = scene.mesh.cell_size or 1.0
    fastest = max(data["material"], key=lambda table: (table.get("youngs_modulus") or 9 * table.get("bulk_modulus", 1.0)) / table["density"])
    body = {"name": "block", "material": fastest["name"], "shape": "box", "lower": [0.0] * dim, "upper": [cells * size] * dim}
    held = {"name": "low", "shape": "half_space", "point": [0.1 * size] + [0.0] * (dim - 1), "normal": [-1.0] + [0.0] * (dim - 1)}
    loads = [{"type": "displacement", "region": "low", "value": [0.0] * dim}, {"type": "gravity", "value": [1.0] * dim}]
    keep = {name: data[name] for name in ("model", "dimension", "fem", "particles", "time") if name in data}
    small = {**keep, "mesh": {"cell_size": size}, "material": [fastest], "body": [body], "region": [held], "load": loads}
    return build(scene_from_dict(small, "block"), MPI.COMM_SELF)


def _rate(scene):
    """Return cells per second and core of a step, measured on a small block."""
    explicit = scene.fem.integration == "explicit"
    problem = _problem(scene, _BLOCK["explicit" if explicit else "implicit", scene.dim])
    stepper, best = problem.stepper(), math.inf
    for _ in range(5 if explicit else 2):
        started = time.perf_counter()
        with contextlib.suppress(SolverError):  # its iterations cost what those of the run's own solve do, which may converge
            stepper.advance()
        best = min(best, time.perf_counter() - started)
    return problem.body.mesh.n_global_cells / best


def _memory(scene, kind, cells, vertices, width):
    """Return bytes of the mesh, its fields, and its matrices."""
    corners = ELEMENTS[kind].corners
    total = cells * _BYTES_PER_CELL[kind] + vertices * (7 * width + 4) * 8
    if scene.from_file:
        total += cells * 8 * ((corners * width) ** 2 + corners * width)
    if scene.fem.integration != "explicit":
        matrices = {"static": 1, "newmark": 3}[scene.fem.integration]
        total += vertices * _NEIGHBOURS[kind] * width**2 * _BYTES_PER_ENTRY * matrices
    return float(total)
