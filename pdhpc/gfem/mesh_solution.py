"""The global solution on the mesh: nodal fields, the forces of elements, masses, loads and prescribed motion.

Elements act with the weight 1 - alpha at their particles' places; what the particles of enriched cells carry is in their own state (local_particles.py).
"""
import numpy as np

from pdhpc import state
from pdhpc.gfem import lanes
from pdhpc.gfem.lattice_material import add_kind_forces, kind_energies
from pdhpc.jit import kernel


class MeshSolution:
    """Nodal fields of one rank; ghosts are fresh after every step.

    Attributes
    ----------
    displacement, velocity (n_vertices, dim), m, m/s: the standard part outside the patches; in them, where elements act too, the mean of the particles around, and
    the coefficients of functions that fade out.
    acceleration, previous_acceleration : of the last step and the one before, m/s^2. outside_mass (n_vertices,), kg: lumped, of cells that are not enriched.
    force (n_vertices, dim), N: of this rank's elements, to be accumulated. loads : [ParticleLoad]. motions : [PrescribedMotion] on vertices.
    """

    def __init__(self, mesh, material, loads, motions):
        """material : LatticeMaterial. Local."""
        self.mesh, self.material, self.loads, self.motions = mesh, material, loads, motions
        shape = len(mesh.points), mesh.dim
        self.displacement, self.velocity, self.acceleration, self.previous_acceleration = (np.zeros(shape) for _ in range(4))
        self.force = np.zeros(shape)
        self._shared = {name: mesh.exchange.bind(getattr(self, name)) for name in ("displacement", "velocity", "acceleration", "previous_acceleration")}
        self.change = np.zeros(shape)  # c of the displacement, then e of the velocity
        self.right = np.zeros(shape)
        self._change, self._right = mesh.exchange.bind(self.change), mesh.exchange.bind(self.right)
        self._half, self._buffer, self.first = np.zeros(shape), np.zeros(8), True
        self.load_work = np.zeros(len(mesh.points))

    def refresh(self, *names):
        """Bring ghosts of the named nodal fields up to date. Collective over neighbours."""
        for name in names:
            self._shared[name].refresh()

    def refresh_change(self):
        """Bring ghosts of `change` up to date. Collective over neighbours."""
        self._change.refresh()

    def gather_right(self):
        """Add what other ranks have of `right` at this rank's vertices. Collective over neighbours."""
        self._right.accumulate()

    def follow(self, patches, weight, without=False):
        """Find which elements act, and how much; sum up lumped masses and loads outside. Collective over neighbours.

        weight : (n_vertices,), 0 or 1, of which alpha is the interpolation. without : (n_owned_cells,) bool, elements that do not act whatever alpha is.
        """
        mesh, material = self.mesh, self.material
        self.enriched = patches.enriched[: mesh.n_owned_cells].copy()
        self._kind, acting = material.ramped_kind(weight)
        self._acting = np.flatnonzero(acting & ~np.asarray(without)).astype(np.int32)
        self.outside_mass = self._summed(np.flatnonzero(~self.enriched), material.lumped)
        self._outside_loads = [load.outside(mesh, self.enriched) for load in self.loads]

    def _summed(self, cells, masses):
        """Return (n_vertices,) kg, masses (n_kinds, corners) of owned cells (n,) of all ranks added up at their vertices. Collective over neighbours."""
        mass = np.zeros((len(self.mesh.points), 1))
        lanes.lump(self.mesh.cells, cells.astype(np.int32), self.material.kind, masses, mass[:, 0])
        shared = self.mesh.exchange.bind(mass)
        shared.accumulate()
        shared.refresh()
        shared.free()
        return mass[:, 0].copy()

    def evaluate(self, time):
        """Store the forces of elements and of loads outside the patches, at the present displacement and `time`, in `force`: this rank's part. Local."""
        self.evaluate_elements()
        for load, nodal in zip(self.loads, self._outside_loads):
            add_scaled(self.force, load.time_function.value(time), nodal)

    def evaluate_elements(self):
        """As `evaluate`, without loads."""
        self.force[:] = 0.0
        add_kind_forces(self.mesh.cells, self._acting, self._kind, self.material.stiffness, self.displacement, self.force, self._buffer)

    def steer(self, time, dt):
        """Put in `change` what takes prescribed components from `time` to where they must be at time + dt. Local."""
        for motion in self.motions:
            motion.steer(self.displacement, self._half, time + dt, dt)
            put_components(motion.indices, motion.components, dt, self._half, self.change)

    def account(self, time, dt):
        """Account for the work of loads outside the patches over the step that ends at `time`; `change` is that of the displacement. Local."""
        for load, nodal in zip(self.loads, self._outside_loads):
            mean = 0.5 * (load.time_function.value(time - dt) + load.time_function.value(time))
            add_work(mean, nodal, self.change, self.load_work)

    def account_motions(self, dt):
        """Account for the work of what holds prescribed components; `right` is dt/2 times the forces at both ends of the step. Local."""
        if self.motions:
            forces = (2.0 / dt) * self.right
            for motion in self.motions:
                motion.do_work(forces, self._half, dt)

    def settle_motions(self, time):
        """Put the prescribed velocities at a time in `change`. Local."""
        for motion in self.motions:
            motion.settle(self.change, time)

    def accept_velocity(self, standard, dt):
        """Take `change` as the velocity of the vertices marked in standard (n_vertices,), and its growth as the acceleration. Local."""
        take_velocity(standard, dt, self.change, self.velocity, self.acceleration, self.previous_acceleration)
        if self.first:  # there was no step before
            np.copyto(self.previous_acceleration, self.acceleration)
            self.first = False

    def begin(self):
        """Give prescribed components their velocity, and take their kinetic energy as that of the start. Collective over neighbours."""
        for motion in self.motions:
            motion.settle(self.velocity, 0.0)
            motion.initial_kinetic[:] = motion.kinetic(self.velocity, 0.5 * self.outside_mass[motion.indices])
        self.refresh("velocity")

    def external_work(self):
        """Return (n,) J, contributions of this rank to the work of loads outside the patches and of prescribed motion. Local."""
        parts = [self.load_work]
        for motion in self.motions:
            parts.append(motion.work + motion.kinetic(self.velocity, 0.5 * self.outside_mass[motion.indices]) - motion.initial_kinetic)
        return np.concatenate(parts)

    def work_state(self):
        """Return {key: Entry} of the work accounts."""
        ids, entries = self.mesh.vertex_id, {"work/mesh_loads": state.rows(self.load_work, state.SUM)}
        for number, motion in enumerate(self.motions):
            entries[f"work/motion_{number}"] = state.rows(motion.work, ids[motion.indices])
            entries[f"initial_kinetic/{number}"] = state.rows(motion.initial_kinetic, ids[motion.indices])
        return entries

    def strain_energies(self):
        """Return (n,) J, of the elements of this rank that act. Local."""
        energy = np.zeros(len(self._acting))
        kind_energies(self.mesh.cells, self._acting, self._kind, self.material.stiffness, self.displacement, energy)
        return energy

    def kinetic_energies(self):
        """Return (n_owned,) J, of the lumped mass outside the patches. Local."""
        n = self.mesh.n_owned
        return 0.5 * self.outside_mass[:n] * (self.velocity[:n] ** 2).sum(axis=1)


@kernel
def add_scaled(target, factor, source):
    """target += factor source, (n, dim) both."""
    for n in range(len(target)):
        for d in range(target.shape[1]):
            target[n, d] += factor * source[n, d]


@kernel
def put_components(vertices, components, factor, source, target):
    """target = factor source in some components of some vertices."""
    for n in range(len(vertices)):
        for c in range(len(components)):
            target[vertices[n], components[c]] = factor * source[vertices[n], components[c]]


@kernel
def take_velocity(standard, dt, change, velocity, acceleration, previous):
    """previous = a, a = (change - v)/dt, v = change where standard (n,) is set; 0 elsewhere."""
    for n in range(len(standard)):
        for d in range(change.shape[1]):
            previous[n, d] = acceleration[n, d]
            acceleration[n, d] = (change[n, d] - velocity[n, d]) / dt if standard[n] else 0.0
            velocity[n, d] = change[n, d] if standard[n] else 0.0


@kernel
def add_work(factor, nodal, change, work):
    """work += factor nodal . change of each vertex."""
    for n in range(len(work)):
        for d in range(nodal.shape[1]):
            work[n] += factor * nodal[n, d] * change[n, d]
