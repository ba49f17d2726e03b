"""All loads and prescribed motions of one rank's particles, or of what else moves under forces, applied in the order of the scene."""
import time

import numpy as np

from pdhpc import state


class Conditions:
    """Loads (BodyForce) and motions (PrescribedMotion), with the work they did.

    Subclasses have forces() -> (n_slots, dim), what loads are added to, volumes(indices) -> (n,) or a number, what takes accounts of work at slots to J,
    and ids(indices) -> (n,) int64, global ids of what is at slots.
    """

    def __init__(self, fields, half_inertia, loads, motions):
        """fields : has displacement and velocity (n_slots, dim). half_inertia : (n,) of each motion, rho/2 or m/2, as forces are per volume or not."""
        self._fields, self._half_inertia, self.loads, self.motions = fields, half_inertia, list(loads), list(motions)

    def add_loads(self, t):
        """Add every load at time t to the forces."""
        for load in self.loads:
            load.add_to(self.forces(), t)

    def place(self, t, share=1.0):
        """Take prescribed displacements a share of the way to where they must be at t, the whole of it with 1."""
        for motion in self.motions:
            motion.place(self._fields.displacement, t, share)

    def steer(self, t, dt):
        """Give prescribed components the half-step velocity that takes them to where they must be at t."""
        for motion in self.motions:
            motion.steer(self._fields.displacement, self._fields.velocity, t, dt)

    def settle(self, t):
        """Give prescribed components their velocity at the full step t."""
        for motion in self.motions:
            motion.settle(self._fields.velocity, t)

    def begin(self):
        """Take the present kinetic energy of prescribed components as that of the start."""
        for motion, half in zip(self.motions, self._half_inertia):
            motion.initial_kinetic[:] = motion.kinetic(self._fields.velocity, half)

    def work_of_old_forces(self, dt):
        """Account for the work of the forces at the step's start; the velocity is that of the half step."""
        for motion in self.motions:
            motion.do_work(self.forces(), self._fields.velocity, dt)

    def work_of_new_forces(self, t, dt):
        """Account for the work of the forces at the step's end (at time t), and of the loads over the whole step."""
        for load in self.loads:
            load.do_work(self._fields.velocity, t, dt)
        self.work_of_old_forces(dt)

    def external_work(self):
        """Return (n,) work done so far at loaded and moved slots, J: its sum is the external work."""
        parts = [load.work * self.volumes(load.indices) for load in self.loads]
        for motion, half in zip(self.motions, self._half_inertia):
            gained = motion.kinetic(self._fields.velocity, half) - motion.initial_kinetic
            parts.append((motion.work + gained) * self.volumes(motion.indices))
        return np.concatenate(parts) if parts else np.empty(0)

    def state(self):
        """Return {key: Entry} of the work accounts."""
        accounts = {f"work/{number}": state.rows(each.work, self.ids(each.indices)) for number, each in enumerate(self.loads + self.motions)}
        for number, motion in enumerate(self.motions):
            accounts[f"initial_kinetic/{number}"] = state.rows(motion.initial_kinetic, self.ids(motion.indices))
        return accounts


class ParticleConditions(Conditions):
    """Conditions on one rank's particles, by slots of owned ones: forces are force densities, N/m^3.

    interactions : what acts on particles by where they are and how fast (contact, impactors): objects with add_to(force_density, t, broken) at every
    evaluation, moved(dt) once positions are those of the step's end, worked(dt) once forces are, both with velocities of the half step; ledger(),
    external_work(), bytes_sent, warnings() and state(). Empty but for whoever sets it. seconds : spent in them, at steps.
    """

    def __init__(self, particles, density, loads=(), motions=()):
        """density : (n_block,), kg/m^3."""
        super().__init__(particles, [0.5 * density[particles.block[motion.indices]] for motion in motions], loads, motions)
        self.particles, self.interactions, self.seconds = particles, [], 0.0

    def add_loads(self, t, broken=0):
        """Add every load and interaction at time t to the forces; broken : directed bonds of this rank that broke so far. Collective with interactions."""
        super().add_loads(t)
        self._interact("add_to", self.forces(), t, broken)

    def start_of_step(self, dt):
        """Account for the work of the forces at the step's start and take what interacts to its end; the velocity is that of the half step. Local."""
        self.work_of_old_forces(dt)
        self._interact("moved", dt)

    def work_of_new_forces(self, t, dt):
        """Account for the work of the forces at the step's end (at time t), and of the loads over the whole step. Local."""
        super().work_of_new_forces(t, dt)
        self._interact("worked", dt)

    def _interact(self, verb, *arguments):
        """Let every interaction do something, and count the time."""
        if self.interactions:
            started = time.perf_counter()
            for each in self.interactions:
                getattr(each, verb)(*arguments)
            self.seconds += time.perf_counter() - started

    def external_work(self):
        """Return (n,) work done so far, J, that of interactions too: its sum is the external work."""
        return np.concatenate([super().external_work(), *(work for each in self.interactions for work in each.external_work())])

    def state(self):
        """Return {key: Entry} of the work accounts and of the interactions."""
        entries = super().state()
        for each in self.interactions:
            entries.update(each.state())
        return entries

    def held(self):
        """Return (n_owned, dim) bool: the components of owned particles whose motion is prescribed."""
        by_slot = np.zeros(self.particles.displacement.shape, bool)
        for motion in self.motions:
            by_slot[np.ix_(motion.indices, motion.components)] = True
        return by_slot[self.particles.slots]

    def forces(self):
        """Return (n_slots, dim) force densities, N/m^3."""
        return self.particles.force_density

    def ids(self, indices):
        """Return (n,) int64, global ids of owned particles by slot."""
        return self.particles.ids_at(indices)

    def volumes(self, indices):
        """Return (n,) volumes, m^3; loads, like masses, are shared between the copies of a particle."""
        volume, share = self.particles.volume[indices], self.particles.mass_share
        return volume if share is None else volume * share[indices]
