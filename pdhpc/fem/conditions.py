"""Loads and prescribed motions on the vertices of one rank, and the work they do: nodal forces, N, where particles have force densities."""
import numpy as np


class NodalConditions:
    """Loads (conditions.loads.BodyForce with vectors in N) and motions (PrescribedMotion), all by slots of owned vertices.

    Over a step, du = dt v_half: a load F does the work (F_n + F_{n+1})/2 . du; holding a component does d(kinetic) - (f_n + f_{n+1})/2 du, f the total force.
    """

    def __init__(self, nodes, loads=(), motions=()):
        """nodes : Nodes, its masses set. Local."""
        self.nodes, self.loads, self.motions = nodes, list(loads), list(motions)
        self._half_mass = [0.5 * nodes.mass[motion.indices] for motion in self.motions]

    def add_loads(self, t):
        """Add every load at time t to the forces."""
        for load in self.loads:
            load.add_to(self.nodes.force, t)

    def steer(self, t, dt):
        """Give prescribed components the half-step velocity that takes them to where they must be at t."""
        for motion in self.motions:
            motion.steer(self.nodes.displacement, self.nodes.velocity, t, dt)

    def settle(self, t):
        """Give prescribed components their velocity at the full step t."""
        for motion in self.motions:
            motion.settle(self.nodes.velocity, t)

    def begin(self):
        """Take the present kinetic energy of prescribed components as that of the start."""
        for motion, half_mass in zip(self.motions, self._half_mass):
            motion.initial_kinetic = motion.kinetic(self.nodes.velocity, half_mass)

    def work_of_old_forces(self, dt):
        """Account for the work of the forces at the step's start; the velocity is that of the half step."""
        for motion in self.motions:
            motion.do_work(self.nodes.force, self.nodes.velocity, dt)

    def work_of_new_forces(self, t, dt):
        """Account for the work of the forces at the step's end (at time t), and of the loads over the whole step."""
        for load in self.loads:
            load.do_work(self.nodes.velocity, t, dt)
        for motion in self.motions:
            motion.do_work(self.nodes.force, self.nodes.velocity, dt)

    def external_work(self):
        """Return (n,) work done so far on loaded and moved vertices, J: its sum is the external work."""
        parts = [load.work for load in self.loads]
        for motion, half_mass in zip(self.motions, self._half_mass):
            parts.append(motion.work + motion.kinetic(self.nodes.velocity, half_mass) - motion.initial_kinetic)
        return np.concatenate(parts) if parts else np.empty(0)

    def constrained(self):
        """Return (n_slots, width) bool: components of owned vertices that follow a motion. Local."""
        flags = np.zeros((self.nodes.n_slots, self.nodes.width), bool)
        for motion in self.motions:
            flags[np.ix_(motion.indices, motion.components)] = True
        return flags

    def state(self):
        """Return {key: (getter, setter)} of the work accounts."""
        accounts = {}
        for number, each in enumerate(self.loads + self.motions):
            accounts[f"work/{number}"] = (lambda each=each: each.work, lambda value, each=each: np.copyto(each.work, value))
        for number, motion in enumerate(self.motions):
            accounts[f"initial_kinetic/{number}"] = (lambda m=motion: m.initial_kinetic, lambda value, m=motion: np.copyto(m.initial_kinetic, value))
        return accounts
