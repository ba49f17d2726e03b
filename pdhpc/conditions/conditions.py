"""All loads and prescribed motions of one subdomain, applied in the order of the scene."""
import numpy as np


class Conditions:
    """Loads (BodyForce) and motions (PrescribedMotion) acting on one rank's particles, with the work they did."""

    def __init__(self, particles, density, loads=(), motions=()):
        """density : (n_block,), kg/m^3."""
        self.particles, self.loads, self.motions = particles, list(loads), list(motions)
        self._half_density = [0.5 * density[particles.block[motion.indices]] for motion in self.motions]

    def add_loads(self, t):
        """Add every load at time t to the force density."""
        for load in self.loads:
            load.add_to(self.particles.force_density, t)

    def steer(self, t, dt):
        """Give prescribed components the half-step velocity that takes them to where they must be at t."""
        for motion in self.motions:
            motion.steer(self.particles.displacement, self.particles.velocity, t, dt)

    def settle(self, t):
        """Give prescribed components their velocity at the full step t."""
        for motion in self.motions:
            motion.settle(self.particles.velocity, t)

    def begin(self):
        """Take the present kinetic energy of prescribed components as that of the start."""
        for motion, half_density in zip(self.motions, self._half_density):
            motion.initial_kinetic = motion.kinetic(self.particles.velocity, half_density)

    def work_of_old_forces(self, dt):
        """Account for the work of the forces at the step's start; the velocity is that of the half step."""
        for motion in self.motions:
            motion.do_work(self.particles.force_density, self.particles.velocity, dt)

    def work_of_new_forces(self, t, dt):
        """Account for the work of the forces at the step's end (at time t), and of the loads over the whole step."""
        particles = self.particles
        for load in self.loads:
            load.do_work(particles.velocity, t, dt)
        for motion in self.motions:
            motion.do_work(particles.force_density, particles.velocity, dt)

    def external_work(self):
        """Return (n,) work done so far on loaded and moved particles, J: its sum is the external work."""
        volume, velocity = self.particles.volume, self.particles.velocity
        if self.particles.mass_share is not None:  # loads, like masses, are shared between the copies of a particle
            volume = volume * self.particles.mass_share
        parts = [load.work * volume[load.indices] for load in self.loads]
        for motion, half_density in zip(self.motions, self._half_density):
            gained = motion.kinetic(velocity, half_density) - motion.initial_kinetic
            parts.append((motion.work + gained) * volume[motion.indices])
        return np.concatenate(parts) if parts else np.empty(0)

    def state(self):
        """Return {key: (getter, setter)} of the work accounts."""
        accounts = {}
        for number, each in enumerate(self.loads + self.motions):
            accounts[f"work/{number}"] = (lambda each=each: each.work, lambda value, each=each: np.copyto(each.work, value))
        for number, motion in enumerate(self.motions):
            accounts[f"initial_kinetic/{number}"] = (lambda m=motion: m.initial_kinetic, lambda value, m=motion: np.copyto(m.initial_kinetic, value))
        return accounts
