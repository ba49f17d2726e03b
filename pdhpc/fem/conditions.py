"""Loads and prescribed motions on the vertices of one rank, and the work they do: nodal forces, N, where particles have force densities."""
import numpy as np

from pdhpc.conditions.conditions import Conditions


class NodalConditions(Conditions):
    """Loads (conditions.loads.BodyForce with vectors in N) and motions (PrescribedMotion), all by slots of owned vertices.

    Over a step, du = dt v_half: a load F does the work (F_n + F_{n+1})/2 . du; holding a component does d(kinetic) - (f_n + f_{n+1})/2 du, f the total force.
    """

    def __init__(self, nodes, loads=(), motions=()):
        """nodes : Nodes, its masses set. Local."""
        super().__init__(nodes, [0.5 * nodes.mass[motion.indices] for motion in motions], loads, motions)
        self.nodes = nodes

    def forces(self):
        """Return (n_slots, width) nodal forces, N."""
        return self.nodes.force

    def volumes(self, indices):
        """Return 1: accounts of nodal forces are in J."""
        return 1.0

    def ids(self, indices):
        """Return (n,) int64, global ids of owned vertices by slot."""
        by_slot = np.full(self.nodes.n_slots, -1, np.int64)
        by_slot[self.nodes.owned_slots] = self.nodes.ids
        return by_slot[indices]

    def constrained(self):
        """Return (n_slots, width) bool: components of owned vertices that follow a motion. Local."""
        flags = np.zeros((self.nodes.n_slots, self.nodes.width), bool)
        for motion in self.motions:
            flags[np.ix_(motion.indices, motion.components)] = True
        return flags
