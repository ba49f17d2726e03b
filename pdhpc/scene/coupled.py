"""Scene -> a coupled run: the mesh, the lattice of particles in it, and what chooses, moves and joins them."""
import math

import numpy as np

from pdhpc.conditions.loads import PrescribedMotion
from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.mesh import cell_partition, make_box_mesh
from pdhpc.gfem.coupled_step import CoupledStep
from pdhpc.gfem.lattice_material import LatticeMaterial
from pdhpc.gfem.loads import ParticleLoad
from pdhpc.gfem.local_particles import LocalParticles
from pdhpc.gfem.mesh_solution import MeshSolution
from pdhpc.gfem.patch_mass import PatchMass
from pdhpc.gfem.patches import Patches
from pdhpc.gfem.pinned import Pinned
from pdhpc.gfem.points import CellLattice
from pdhpc.gfem.stable_step import lumped_step
from pdhpc.parallel.comm import largest
from pdhpc.scene.body import make_body, make_shape
from pdhpc.scene.build import _cut_cracks, _force_densities, _selected, _time_function
from pdhpc.scene.parts import make_part
from pdhpc.scene.rules import section

_LARGEST_SHARE = 0.8  # of the lumped mesh's critical step: 0.73 was stable, 0.91 was not
_ACTIVE = 64  # weight of a cell that a pre-crack crosses, in the partition; others count as 1


class CoupledBuild:
    """The parts of a coupled run on one rank, put together. Collective."""

    def __init__(self, scene, comm):
        self.scene, self.comm = scene, comm
        self.body = body = make_body(scene)
        lower, upper, counts = _box(scene, body)
        partition = cell_partition(comm, lower, upper, counts, self._weight)
        self.mesh = make_box_mesh(comm, lower, upper, counts, partition, self._holds_particle)
        self.part = make_part(scene, body, comm, partition)
        subdomain = self.part.subdomain
        self.lattice = CellLattice(self.mesh, subdomain, ELEMENTS[self.mesh.kind], scene.particles.spacing)
        for name in scene.damage.no_fail:
            _selected(scene, body, [self.part], comm, name, "damage.no_fail")
        self.material = LatticeMaterial(self.lattice, subdomain, body.law, self._continuum())
        _cut_cracks(scene, [self.part], comm)
        self.part.settle_bonds(body.law)
        self.part.find_critical_step(body.law)
        self.loads, self.motions, barred = self._conditions()
        self.solution = MeshSolution(self.mesh, self.material, self.loads, self.motions)
        self.patches = Patches(self.mesh, barred)
        may_not_fail = np.arange(256, dtype=np.uint8)
        for (material, _), block in body.blocks.items():
            may_not_fail[block] = body.blocks[material, False]
        self.local = LocalParticles(self.lattice, subdomain, body.law, self.part.exchange, may_not_fail, self.loads)
        self._set_initial_state()
        self.solution.follow(self.patches, np.zeros(len(self.mesh.points)), self.local.outside)
        self.critical_dt = lumped_step(comm, self.solution)

    def stepper(self, dt, k):
        """Return the CoupledStep of global steps dt, s, with k sub-steps. Collective."""
        setting, mesh = self.scene.gfem, self.mesh
        mass = PatchMass(self.comm, mesh, self.material)
        scheme = Pinned(self.solution, self.local, mass, dt, k)
        activation = 0.6 if setting.activation is None else setting.activation
        stepper = CoupledStep(self.comm, self.patches, self.local, self.solution, scheme, activation)
        chosen = np.ones(mesh.n_owned_cells, bool) if setting.everywhere else self._cracked()
        self.patches.add(chosen)
        stepper.follow()
        return stepper

    def _cracked(self):
        """Return (n_owned_cells,) bool, cells with a particle that has lost a bond to a pre-crack."""
        particles, bonds = self.part.subdomain.particles, self.part.subdomain.bonds
        cut = np.zeros(len(particles.position), bool)
        cut[bonds.slots[bonds.initial_size < bonds.family_size]] = True
        slots = self.lattice.slots_of(np.arange(self.mesh.n_owned_cells, dtype=np.int32))
        return ((slots >= 0) & cut[slots]).any(axis=1)

    def _weight(self, centres):
        """Return (n,) int, about the work of cells: those near a pre-crack have particles."""
        near = np.full(len(centres), self.scene.gfem.everywhere)
        reach = 2.0 * self.scene.mesh.cell_size
        for crack in self.scene.crack:
            for start, end in zip(np.array(crack.points[:-1], float), np.array(crack.points[1:], float)):
                along = np.clip((centres - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
                near |= np.linalg.norm(centres - start - along[:, None] * (end - start), axis=1) < reach
        return np.where(near, _ACTIVE, 1)

    def _holds_particle(self, centres):
        """Return (n,) bool: cells of the mesh that hold a particle."""
        h, size = self.scene.particles.spacing, self.scene.mesh.cell_size
        places = (np.arange(round(size / h)) + 0.5) * h - 0.5 * size
        inside = np.stack(np.meshgrid(*[places] * centres.shape[1], indexing="ij"), axis=-1).reshape(-1, centres.shape[1])
        points = (centres[:, None, :] + inside).reshape(-1, centres.shape[1])
        held = np.zeros(len(points), bool)
        for lattice in self.body.lattices:
            held |= lattice.contains(points)
        return held.reshape(len(centres), -1).any(axis=1)

    def _continuum(self):
        """Return (n_block, 3, 3), Pa, or None where the moduli are the lattice's."""
        if self.scene.moduli != "continuum":
            return None
        from pdhpc.fem.moduli import isotropic
        from pdhpc.scene.schema import POISSONS_RATIO

        dimension = self.scene.dimension
        return np.array([isotropic(self.scene.material[number].youngs_modulus, POISSONS_RATIO[dimension], dimension) for number, _ in self.body.blocks])

    def _conditions(self):
        """Return (loads on particles, motions of vertices, (n_cells,) bool cells that may not be enriched). Collective."""
        scene, comm, part = self.scene, self.comm, self.part
        loads, motions, barred = [], [], np.zeros(len(self.mesh.cells), bool)
        for number, load in enumerate(scene.load):
            key = f"{section('load', number, load)}: region"
            if load.type in ("displacement", "velocity"):
                vertices = self._vertices(load.region, key)
                components = [axis for axis, value in enumerate(load.value) if value != "free"]
                owned = vertices[: self.mesh.n_owned]
                motions.append(PrescribedMotion(np.flatnonzero(owned), components, [load.value[axis] for axis in components], _time_function(load.time), load.type))
                barred |= vertices[self.mesh.cells].any(axis=1)
            else:
                selected = _selected(scene, self.body, [part], comm, load.region, key)
                density = _force_densities(scene, self.body, load, [part], selected, comm)[0]
                members = np.flatnonzero(selected[0][: part.subdomain.particles.n_owned])
                loads.append(ParticleLoad(self.lattice, part.subdomain, part.subdomain.particles.slots[members], density[members], _time_function(load.time)))
        return loads, motions, barred

    def _vertices(self, name, key):
        """Return (n_vertices,) bool, the vertices in a region, which holds at least one. Collective."""
        points = self.mesh.points
        if name == "all":
            return np.ones(len(points), bool)
        region = next(each for each in self.scene.region if each.name == name)
        inside = make_shape(region).contains(points)
        if region.body is not None:
            number = [each.name for each in self.scene.body].index(region.body)
            inside &= self.body.lattices[number].shape.contains(points)
        if not largest(self.comm, int(inside[: self.mesh.n_owned].any())):
            raise self.scene.error(key, f'"{name}", which holds no vertex of the mesh', "a region that holds one: vertices lie on the edges of the body, and cell_size apart")
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


def _box(scene, body):
    """Return (lower, upper, counts) of the box of cells around all bodies."""
    bounds = np.array([lattice.bounds() for lattice in body.lattices])
    lower, upper = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    return lower, upper, np.maximum(1, np.rint((upper - lower) / scene.mesh.cell_size)).astype(np.int64)


def choose_steps(scene, critical, particle_critical):
    """Return (dt, k): the global step and its sub-steps.

    Raises
    ------
    SceneError: a global step above 0.8 of the lumped mesh's critical one, or sub-steps above the particles' critical step.
    """
    setting = scene.time
    if setting.dt == "auto":
        n_steps = max(1, math.ceil(setting.end / (scene.safety * critical)))
        dt = setting.end / n_steps
    else:
        dt = setting.dt
        if dt > _LARGEST_SHARE * critical and not setting.allow_unstable:
            raise scene.error("time.dt", f"{dt:g} s, {dt / critical:.3f} of the lumped mesh's critical step {critical:.6g} s", "up to 0.8 of it, unless time.allow_unstable = true")
    limit = min(setting.safety, 0.9) * particle_critical
    k = scene.gfem.substeps
    return dt, max(1, math.ceil(dt / limit * (1 - 1e-12))) if k == "auto" else k
