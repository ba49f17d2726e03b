"""Scene -> a coupled run: the mesh, the lattice of particles in it, and what chooses, moves and joins them."""
import math

import numpy as np

from pdhpc.conditions.loads import PrescribedMotion
from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.mesh import cell_partition, make_box_mesh
from pdhpc.fem.moduli import isotropic
from pdhpc.gfem.coupled_step import CoupledStep
from pdhpc.gfem.lattice_material import LatticeMaterial
from pdhpc.gfem.loads import ParticleLoad
from pdhpc.gfem.local_particles import LocalParticles
from pdhpc.gfem.mesh_solution import MeshSolution
from pdhpc.gfem.patches import Patches
from pdhpc.gfem.points import CellLattice
from pdhpc.gfem.schemes import make_scheme
from pdhpc.gfem.stable_step import coupled_step
from pdhpc.observers.enrichment import Enrichment, EnrichmentGuard
from pdhpc.observers.enrichment_output import EnrichmentOutput
from pdhpc.parallel.comm import largest
from pdhpc.scene.body import make_body, make_shape
from pdhpc.scene.build import cut_cracks
from pdhpc.scene.conditions import force_densities, select_particles, time_function
from pdhpc.scene.mesh_rules import LARGEST_SHARE
from pdhpc.scene.methods import ACTIVATION, TOLERANCE
from pdhpc.scene.parts import make_part
from pdhpc.scene.problem import Problem
from pdhpc.scene.schema import POISSONS_RATIO
from pdhpc.scene.sections import section
from pdhpc.scene.steps import choose_step

_ACTIVE = 64  # weight of a cell that a pre-crack crosses, in the partition; others count as 1
_SUB_STEP_SHARE = 0.57  # of the particles' critical step that a sub-step takes: 4 sub-steps at H/h = 5, 6 at 10


def build_coupled(scene, comm):
    """Return the CoupledProblem of a scene on this rank. Collective.

    Raises
    ------
    SceneError, on every rank: as build.build; a global step above 0.8 of the critical one, sub-steps above the particles'.
    """
    parts = CoupledParts(scene, comm)
    dt, n_steps, warnings = choose_step(scene, parts.critical_dt, LARGEST_SHARE)
    k = _choose_sub_steps(scene, dt, parts.part.critical_dt)
    return CoupledProblem(scene, parts, dt, k, n_steps, warnings)


def _choose_sub_steps(scene, dt, critical):
    """Return k; dt/k is at most 0.57 (or time.safety, if that is less) of the particles' critical step when the scene leaves it open."""
    k, least = scene.gfem.substeps, max(1, math.ceil(dt / (min(scene.safety, _SUB_STEP_SHARE) * critical) * (1 - 1e-12)))
    if k == "auto":
        return least
    if dt / k > critical and not scene.time.allow_unstable:
        allowed = f'"auto" or at least {math.ceil(dt / critical)}: the particles\' critical step is {critical:.6g} s'
        raise scene.error("gfem.substeps", f"{k}, sub-steps of {dt / k:g} s", allowed)
    return k


class CoupledProblem(Problem):
    """Everything one rank needs to run a coupled scene. k : sub-steps of the particles in a step."""

    def __init__(self, scene, parts, dt, k, n_steps, warnings):
        self.coupled_parts, self.k = parts, k
        super().__init__(scene, parts.body, [parts.part], parts.critical_dt, dt, 1, n_steps, warnings, lambda dt: parts.stepper(dt, k))

    def sizes(self, stepper, comm):
        """Return what run.json says of the body. Collective."""
        mesh = self.coupled_parts.mesh
        return {**super().sizes(stepper, comm), "cells": mesh.n_global_cells, "vertices": mesh.n_global_vertices}

    def share(self):
        """Return {what: number} of this rank's part of the body, for the log. Local."""
        mesh = self.coupled_parts.mesh
        return {"cells": mesh.n_owned_cells, "vertices": mesh.n_owned, **super().share()}

    def work(self, stepper, comm, seconds):
        """Return what run.json says of the work done in `seconds` of stepping, the mean over ranks. Collective."""
        evaluations = sum(int(comm.allreduce(count)) for count in stepper.bond_evaluations.values())
        mine = np.array(comm.allgather([stepper.local.particle_steps, stepper.bytes_sent]))
        return {
            "bond_evaluations": evaluations,
            "particle_steps": int(mine[:, 0].sum()),
            "particle_steps_per_second_and_core": float(mine[:, 0].sum() / (seconds * comm.size)) if seconds > 0 else None,
            "bytes_sent_per_step": int(mine[:, 1].sum()),
            "particle_imbalance": float(mine[:, 0].max() / max(mine[:, 0].mean(), 1)),
        }

    def coupling(self, stepper, comm):
        """Return the gauge of the enrichment. Collective."""
        return Enrichment(comm, stepper)

    def supports(self, comm, name):
        """Return (n,) owned vertices of prescribed motion in a region, None where it holds none on any rank. Collective."""
        held = self.coupled_parts.held(name)
        return held if comm.allreduce(len(held)) else None

    def guards(self, stepper, comm, steps):
        """Return the observers that stop a run whose coupling fails. Local."""
        return [EnrichmentGuard(comm, steps)]

    def outputs(self, comm, directory):
        """Return the observer that writes the enriched space of the end for its picture. Local."""
        return [EnrichmentOutput(comm, directory)] if self.scene.output.pictures else []

    def coupled(self, stepper, comm, coupling):
        """Return what run.json says of the coupling. Collective."""
        return {"scheme": stepper.scheme.name, "sub_steps": self.k, "particle_dt": self.dt / self.k, "particle_critical_dt": self.parts[0].critical_dt,
                "step_over_critical": self.dt / self.critical_dt, **coupling.summary()}


class CoupledParts:
    """The parts of a coupled run on one rank.

    Attributes
    ----------
    body : Body. mesh : Mesh. part : Part, particles of the whole body. lattice : CellLattice. material : LatticeMaterial. solution : MeshSolution.
    patches : Patches. local : LocalParticles. critical_dt, s: of the lumped mesh, less at H/h > 5.
    """

    def __init__(self, scene, comm):
        """Put the parts together. Collective."""
        self.scene, self.comm = scene, comm
        self.body = body = make_body(scene)
        lower, upper, counts = _box(scene, body)
        partition = cell_partition(comm, lower, upper, counts, self._weight)
        self.mesh = make_box_mesh(comm, lower, upper, counts, partition, self._is_in_a_body)
        self.part = make_part(scene, body, comm, partition)
        subdomain = self.part.subdomain
        self.lattice = CellLattice(self.mesh, subdomain, ELEMENTS[self.mesh.kind], scene.particles.spacing)
        for name in scene.damage.no_fail:
            select_particles(scene, body, [self.part], comm, name, "damage.no_fail")
        self.material = LatticeMaterial(self.lattice, subdomain, body.law, self._continuum())
        cut_cracks(scene, [self.part], comm)
        self.part.settle_bonds(body.law)
        self.part.find_critical_step(body.law)
        loads, motions, barred = self._conditions()
        self.solution = MeshSolution(self.mesh, self.material, loads, motions)
        self.patches = Patches(self.mesh, barred)
        may_not_fail = np.arange(256, dtype=np.uint8)
        for (material, _), block in body.blocks.items():
            may_not_fail[block] = body.blocks[material, False]
        self.local = LocalParticles(self.lattice, subdomain, body.law, self.part.exchange, may_not_fail, loads)
        self._set_initial_state()
        self.solution.follow(self.patches, np.zeros(len(self.mesh.points)))
        self.solution.begin()
        self.critical_dt = coupled_step(comm, self.solution, self.lattice.ratio)

    def stepper(self, dt, k):
        """Return the CoupledStep of global steps dt, s, with k sub-steps. Collective."""
        setting, mesh = self.scene.gfem, self.mesh
        tolerance = TOLERANCE if setting.tolerance is None else setting.tolerance
        scheme = make_scheme(setting.scheme, self.solution, self.local, (dt, k), tolerance, not self.scene.time.allow_unstable)
        stepper = CoupledStep(self.comm, self.patches, self.local, self.solution, scheme, ACTIVATION if setting.activation is None else setting.activation)
        self.patches.add(self._cracked())
        self._check_cracks()
        if setting.everywhere:
            self.patches.add(np.ones(mesh.n_owned_cells, bool))
        self.patches.refused = 0
        stepper.follow()
        return stepper

    def _check_cracks(self):
        """Raise a SceneError for pre-cracks that cut bonds in cells which particles cannot have to themselves. Collective."""
        mesh = self.mesh
        lost = np.flatnonzero(self._cracked() & ~self.patches.whole[: mesh.n_owned_cells])
        places = self.comm.allgather([tuple(float(x) for x in mesh.points[mesh.cells[cell]].mean(axis=0)) for cell in lost[:1]])
        count = self.comm.allreduce(len(lost))
        if count:
            place = ", ".join(f"{x:.4g}" for x in min(each for found in places for each in found))
            raise self.scene.error("crack", f"pre-cracks that cut bonds in {count} cells, one around ({place}) m, within two cells of where motion is prescribed",
                                   'cracks farther from such regions, whose surroundings stay elements, tractions in their place, or model = "particles"')

    def _cracked(self):
        """Return (n_owned_cells,) bool, cells with a particle that has lost a bond to a pre-crack."""
        bonds, cracked = self.part.subdomain.bonds, np.zeros(self.mesh.n_owned_cells, bool)
        cracked[self.lattice.cell_of(bonds.slots[bonds.initial_size < bonds.family_size])[0]] = True
        return cracked

    def _weight(self, centres):
        """Return (n,) int, about the work of cells: those near a pre-crack have particles."""
        near = np.full(len(centres), self.scene.gfem.everywhere)
        reach = 2.0 * self.scene.mesh.cell_size
        for crack in self.scene.crack:
            for start, end in zip(np.array(crack.points[:-1], float), np.array(crack.points[1:], float)):
                along = np.clip((centres - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
                near |= np.linalg.norm(centres - start - along[:, None] * (end - start), axis=1) < reach
        return np.where(near, _ACTIVE, 1)

    def _is_in_a_body(self, centres):
        """Return (n,) bool: cells of the mesh that lie in a body, which are made of whole cells."""
        held = np.zeros(len(centres), bool)
        for lattice in self.body.lattices:
            held |= lattice.contains(centres)
        return held

    def _continuum(self):
        """Return (n_block, 3, 3), Pa, or None where the moduli are the lattice's."""
        if self.scene.moduli != "continuum":
            return None
        dimension, materials = self.scene.dimension, self.scene.material
        return np.array([isotropic(materials[number].youngs_modulus, POISSONS_RATIO[dimension], dimension) for number, _ in self.body.blocks])

    def _conditions(self):
        """Return (loads on particles, motions of vertices, (n_cells,) bool cells that may not be enriched). Collective."""
        scene, comm, part = self.scene, self.comm, self.part
        loads, motions, barred = [], [], np.zeros(len(self.mesh.cells), bool)
        held = np.zeros((self.mesh.n_owned, self.mesh.dim), bool)
        for number, load in enumerate(scene.load):
            key = f"{section('load', number, load)}: region"
            if load.type in ("displacement", "velocity"):
                vertices = self._vertices(load.region, key)
                components = [axis for axis, value in enumerate(load.value) if value != "free"]
                chosen = np.ix_(np.flatnonzero(vertices[: self.mesh.n_owned]), components)
                if comm.allreduce(int(held[chosen].sum())):
                    raise scene.error(key, f'"{load.region}", where another load prescribes the same component', "regions that do not overlap")
                held[chosen] = True
                motions.append(PrescribedMotion(chosen[0].ravel(), components, [load.value[axis] for axis in components], time_function(load.time), load.type))
                barred |= vertices[self.mesh.cells].any(axis=1)
            else:
                selected = select_particles(scene, self.body, [part], comm, load.region, key)
                density = force_densities(scene, self.body, load, [part], selected, comm)[0]
                members = np.flatnonzero(selected[0][: part.subdomain.particles.n_owned])
                loads.append(ParticleLoad(self.lattice, part.subdomain, part.subdomain.particles.slots[members], density[members], time_function(load.time)))
        return loads, motions, barred

    def _vertices(self, name, key):
        """Return (n_vertices,) bool, the vertices in a region, which holds at least one. Collective."""
        inside = self._inside(name)
        if not largest(self.comm, int(inside[: self.mesh.n_owned].any())):
            allowed = "a region that holds one: vertices lie on the edges of the body, and cell_size apart"
            raise self.scene.error(key, f'"{name}", which holds no vertex of the mesh', allowed)
        return inside

    def held(self, name):
        """Return (n,) owned vertices in a region of which a component is prescribed. Local."""
        inside = self._inside(name)[: self.mesh.n_owned]
        return np.flatnonzero(inside & np.isin(np.arange(self.mesh.n_owned), np.concatenate([[], *(motion.indices for motion in self.solution.motions)])))

    def _inside(self, name):
        """Return (n_vertices,) bool, the vertices in a region. Local."""
        points = self.mesh.points
        if name == "all":
            return np.ones(len(points), bool)
        region = next(each for each in self.scene.region if each.name == name)
        inside = make_shape(region).contains(points)
        if region.body is not None:
            number = [each.name for each in self.scene.body].index(region.body)
            inside &= self.body.lattices[number].shape.contains(points)
        return inside

    def _set_initial_state(self):
        """Set nodal displacements and velocities. Collective."""
        for number, initial in enumerate(self.scene.initial):
            inside = self._vertices(initial.region, f"initial[{number}]: region")
            offset = self.mesh.points - np.asarray(initial.origin if initial.origin is not None else [0.0] * self.mesh.dim)
            for target, constant, gradient in (
                (self.solution.displacement, initial.displacement, initial.displacement_gradient),
                (self.solution.velocity, initial.velocity, initial.velocity_gradient),
            ):
                if constant is not None:
                    target[inside] += np.asarray(constant)
                if gradient is not None:
                    target[inside] += offset[inside] @ np.asarray(gradient).T
            about_axis = initial.about_axis(self.mesh.dim)
            if about_axis is not None:
                self.solution.velocity[inside] += about_axis.velocity(self.mesh.points[inside])


def _box(scene, body):
    """Return (lower, upper, counts) of the box of cells around all bodies."""
    bounds = np.array([lattice.bounds() for lattice in body.lattices])
    lower, upper = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    return lower, upper, np.maximum(1, np.rint((upper - lower) / scene.mesh.cell_size)).astype(np.int64)
