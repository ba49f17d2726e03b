"""Scene -> finite elements alone: the mesh, its material, loads, time step and stepper."""
import math
from dataclasses import dataclass
from typing import Callable, List

import numpy as np

from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.critical_step import critical_step
from pdhpc.fem.elasticity import Elasticity
from pdhpc.fem.explicit import Explicit
from pdhpc.fem.internal_forces import InternalForces, make_sweep
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.pieces import Pieces, find_free_piece, find_pieces
from pdhpc.fem.view import MeshView
from pdhpc.parallel.comm import largest, smallest
from pdhpc.scene.lattice_elasticity import make_lattice_elasticity
from pdhpc.scene.mesh_body import MeshBody, checked_locally, locking, make_mesh_body, moduli_of
from pdhpc.scene.mesh_sets import MeshSets, make_loads, set_initial_state
from pdhpc.scene.point_bodies import repetitions
from pdhpc.scene.problem import Uncoupled
from pdhpc.scene.steps import choose_step

_NEWMARK_STEPS = 100  # to time.end, where the scene does not name the step


@dataclass
class ElasticProblem(Uncoupled):
    """Everything one rank needs to run a scene of finite elements; the face of scene.problem.Problem.

    body : MeshBody. elasticity : Elasticity. nodes : Nodes. conditions : NodalConditions. sets : MeshSets. pieces : Pieces.
    load_records : what run.json says of the forces.
    critical_dt : s, of central differences; infinite for implicit integration. make_stepper : function dt -> what advances.
    """

    scene: object
    body: MeshBody
    elasticity: Elasticity
    nodes: Nodes
    conditions: NodalConditions
    sets: MeshSets
    pieces: Pieces
    load_records: List[dict]
    critical_dt: float
    dt: float
    n_steps: int
    warnings: List[str]
    make_stepper: Callable

    def stepper(self):
        """Return what advances this problem from t = 0. Collective."""
        stepper = self.make_stepper(self.dt)
        if self.scene.fem.integration == "explicit":
            stepper.view = MeshView(self.elasticity, self.nodes, lambda: self.nodes.owned(self.nodes.force))
        else:
            stepper.view = MeshView(self.elasticity, self.nodes, lambda: _net_forces(stepper))
        return stepper

    def members(self, view, comm, name, key):
        """Return the vertices of a view in a region as indices; `key` names the region in an error. Collective."""
        return np.flatnonzero(self.sets.vertices(name, key))

    def sizes(self, stepper, comm):
        """Return what run.json says of the body. Local."""
        mesh, fem = self.body.mesh, self.scene.fem
        return {
            "cells": mesh.n_global_cells,
            **({"pieces": self.pieces.count} if self.pieces.count > 1 else {}),
            "cell_kind": mesh.kind,
            "vertices": mesh.n_global_vertices,
            "dofs": mesh.n_global_vertices * self.elasticity.width,
            "integration": fem.integration,
            "moduli": self.scene.moduli,
            "loads": self.load_records,
            "partition_of_unity": fem.partition_of_unity,
        }

    def share(self):
        """Return {what: number} of this rank's part of the body, for the log. Local."""
        mesh = self.body.mesh
        return {"cells": mesh.n_owned_cells, "vertices": mesh.n_owned, "ghost vertices": len(mesh.points) - mesh.n_owned}

    def work(self, stepper, comm, seconds):
        """Return what run.json says of the work done in `seconds` of stepping, the mean over ranks. Collective."""
        mesh = self.body.mesh
        per_rank = np.array(comm.allgather([mesh.n_owned_cells, len(mesh.points) - mesh.n_owned]))
        return {
            "cell_steps_per_second_and_core": mesh.n_global_cells * stepper.step / (seconds * comm.size) if seconds > 0 else None,
            "ksp_iterations": getattr(stepper, "iterations", 0),
            "ghosts": int(per_rank[:, 1].sum()),
            "bytes_sent_per_step": int(comm.allreduce(stepper.bytes_sent)),
            "cell_imbalance": float(per_rank[:, 0].max() / max(per_rank[:, 0].mean(), 1)),
        }


def build_elastic(scene, comm):
    """Return the ElasticProblem of a scene. Collective.

    Raises
    ------
    SceneError, on every rank: as make_mesh_body; a region, load or probe that selects nothing, a step above the critical one, a body that nothing holds.
    """
    explicit = scene.fem.integration == "explicit"
    body = make_mesh_body(scene, comm)
    _check_probes(scene, body.mesh, comm)
    if scene.moduli == "lattice":
        elasticity = make_lattice_elasticity(scene, body, comm)
    else:
        elasticity = checked_locally(scene, comm, _make_elasticity, scene, body)
    nodes = Nodes(body.mesh) if explicit else Nodes(body.mesh, False, elasticity.width)
    if explicit:
        nodes.set_mass(checked_locally(scene, comm, elasticity.lumped_mass, nodes.stars))
    sets = MeshSets(scene, body, comm)
    loads, motions, records = make_loads(scene, sets, elasticity, nodes)
    conditions = NodalConditions(nodes, loads, motions)
    set_initial_state(scene, sets, elasticity, nodes)
    if explicit:
        critical, make_stepper = _explicit(elasticity, nodes, conditions)
        step = choose_step(scene, critical)
    else:
        critical, make_stepper = math.inf, _implicit(scene, elasticity, nodes, conditions)
        step = _implicit_step(scene)
    pieces = find_pieces(body.mesh)
    if scene.fem.integration == "static":
        _check_supports(scene, elasticity, conditions, pieces)
    dt, n_steps, warnings = step
    return ElasticProblem(scene, body, elasticity, nodes, conditions, sets, pieces, records, critical, dt, n_steps, warnings + locking(scene) + repetitions(scene.mesh.file, body.mesh.repeated), make_stepper)


def _make_elasticity(scene, body):
    """Return the Elasticity of a scene. Local."""
    moduli, density = moduli_of(scene)
    return Elasticity(body.mesh, moduli, density, body.kind, scene.thickness, _basis(scene, body.mesh))


def _basis(scene, mesh):
    """Return the basis of the cells, None for the usual hats."""
    if scene.fem.partition_of_unity == "hat":
        return None
    from pdhpc.fem.flat_top import FlatTop

    return FlatTop(mesh.kind)


def _explicit(elasticity, nodes, conditions):
    """Return (critical step, s, function dt -> Explicit). Collective."""
    stiffness = elasticity.stiffness()
    sweep = make_sweep(nodes, stiffness)
    forces = InternalForces(nodes, sweep, nodes.new_field(), nodes.new_field())
    critical = critical_step(elasticity, stiffness, nodes, forces)
    forces.free()
    return float(f"{critical:.10e}"), lambda dt: Explicit(nodes, sweep, conditions, dt)


def _implicit(scene, elasticity, nodes, conditions):
    """Return function dt -> Static or Newmark."""
    if scene.fem.integration == "static":
        from pdhpc.fem.static import Static as Stepper
    else:
        from pdhpc.fem.newmark import Newmark as Stepper
    return lambda dt: Stepper(elasticity, nodes, conditions, dt)


def _implicit_step(scene):
    """Return (dt, number of steps, warnings) of implicit integration: one step to time.end, or the scene's, or a hundredth of time.end."""
    end = scene.time.end
    if scene.fem.integration == "static":
        return end, 1, []
    if scene.time.dt == "auto":
        return end / _NEWMARK_STEPS, _NEWMARK_STEPS, []
    return scene.time.dt, max(1, math.ceil(end / scene.time.dt * (1 - 1e-12))), []


def _check_supports(scene, elasticity, conditions, pieces):
    """Raise a SceneError unless the prescribed components leave no rigid motion of any piece of the mesh free. Collective."""
    fixed = conditions.nodes.owned(conditions.constrained())
    found = find_free_piece(elasticity.basis, elasticity.mesh, pieces, fixed)
    if found is None:
        return
    motions = f"{found.motions} rigid motion{'s' if found.motions > 1 else ''}"
    free, whole = f"{motions} of the body free", "the body"
    if pieces.count > 1:
        place = ", ".join(f"{x:.6g}" for x in found.place)
        others = f" and some of {found.others} others" if found.others else ""
        free = f"{motions} free of the piece at ({place}) m{others}, of the mesh's {pieces.count} pieces, each of cells that share {'edges' if scene.dim == 2 else 'faces'}"
        whole = "each piece"
    allowed = f'displacements that hold {whole} against all of them: fem.integration = "static" finds no equilibrium otherwise'
    raise scene.error("load", f"prescribed displacements that leave {free}", allowed)


def _check_probes(scene, mesh, comm):
    """Raise a SceneError for a probe at a point farther from all vertices than the longest cell. Collective."""
    corners = mesh.points[mesh.cells]
    reach = largest(comm, float(np.ptp(corners, axis=1).max(initial=0.0)) * math.sqrt(mesh.dim))
    for probe in scene.probe:
        if probe.point is not None:
            distance = smallest(comm, float(np.linalg.norm(mesh.points - np.asarray(probe.point), axis=1).min(initial=np.inf)))
            if distance > reach:
                found = f"{probe.point}, {distance:.3g} m from the nearest vertex"
                raise scene.error(f"probe '{probe.name}': point", found, f"a point within a cell ({reach:.3g} m) of one")


def _net_forces(stepper):
    """Return (n_owned, dim), N: loads less internal forces of an implicit stepper. Collective over neighbouring ranks."""
    from pdhpc.fem.implicit import refreshed

    nodes, dim = stepper.nodes, stepper.nodes.dim
    return (nodes.owned(nodes.force) - stepper.stiffness.multiply(refreshed(nodes, nodes.displacement)))[:, :dim]
