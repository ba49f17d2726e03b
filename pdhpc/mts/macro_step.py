"""The multi-time-step method: one macro step.

With regions s = A (coarse, one step dT), B (fine, m steps dT/m), B_A = C and B_B = -C picking the copies of the overlap, and multipliers L:

    M_s a + f_s(u) + B_s^T L = F_s,    sum_s B_s v_s = 0 at macro times.
"""
import numpy as np

from pdhpc.mts.energy import conserved_energy, inertia_of
from pdhpc.mts.two_regions import Timer, TwoRegions
from pdhpc.state import SUM, number


class MultiTimeStep(TwoRegions):
    """Two regions at their own time steps, coupled on their overlap (Lindsay, Parks & Prakash 2016; Prakash, Taciroglu & Hjelmstad 2014).

    Attributes
    ----------
    interface : Interface. operator : of interface_operator.py. common_bonds : CommonBonds, or None where no bond can break.
    iterations : of the interface solver so far.
    """

    def __init__(self, coarse, fine, m, interface, operator, common_bonds, stiffness=None):
        """Give the copies one acceleration. Collective. stiffness : LinearForces of both regions, for E*; None in finite kinematics."""
        super().__init__(coarse, fine, m)
        self.interface, self.operator, self.common_bonds, self.iterations = interface, operator, common_bonds, 0
        self._stiffness = stiffness
        if operator.keeps_multipliers:
            interface.start_multipliers()

    def advance(self):
        """Do one macro step from t_n to t_n + dT:

            free pass    every region with its own dt under the multipliers L_n held fixed; bonds break
            gap          r = sum_s B_s v_s
            solve        H x = r, H the velocity that a ramp of multipliers to x takes out of the gap
            link pass    add to each region its linear response to the ramp -B_s^T x
            accept       L_{n+1} = L_n + x; bonds broken in one copy are broken in both

        Collective over the owners of neighbours and of copies, and over the ranks of the fine region in the solve.
        """
        self.free_pass()
        gap = self.velocity_gap()
        x = self.solve(gap)
        self.link_pass(x)
        self.accept(x)

    def free_pass(self):
        """Let each region step on its own: the coarse one's sweep goes on piece by piece between the sub-steps, so that no rank waits for another region."""
        coarse = self.coarse.advance_in(self.m)
        for _ in range(self.m):
            next(coarse, None)
            self.fine.advance()
        for _ in coarse:
            pass
        self.step += 1

    def velocity_gap(self):
        """Return r = v_A - v_B, (n, dim) m/s, at this rank's fine copies."""
        with self._timed("interface_wait"):
            return self.interface.velocity_gap()

    def solve(self, gap):
        """Return x, N/m^3, with H x = r."""
        with self._timed("interface"):
            x = self.operator.solve(gap)
        self.iterations += self.operator.iterations
        return x

    def link_pass(self, x):
        """Let both regions respond to the ramp of x."""
        with self._timed("interface"):
            self.operator.respond(x)
        with self._timed("interface_wait"):
            self._coarse_x = self.interface.to_coarse(x)
        with self._timed("interface"):
            self.operator.slow_coarse(self._coarse_x)

    def accept(self, x):
        """Take over the multipliers, and the bonds that broke in either copy."""
        with self._timed("interface"):
            if self.operator.keeps_multipliers:
                self.interface.raise_multipliers(x, self._coarse_x)
            if self.common_bonds is not None:
                self.common_bonds.unify()

    @property
    def bond_evaluations(self):
        """Directed bonds that this rank evaluated so far: {"coarse", "fine", "interface"}."""
        return {**super().bond_evaluations, "interface": self.operator.bond_evaluations}

    def conserved_quantity(self):
        """Return (n,) contributions of this rank's particles to what the coupling conserves, see observers/coupling.py. Collective over neighbours.

        E* = sum_s 1/2 a'(M_s - dt_s^2/4 K_s) a + 1/2 v' K_s v with multipliers (NaN in finite kinematics), and with kicks kinetic + strain - external work
        - dt_s^2/8 a' M_s a.
        """
        if self.operator.keeps_multipliers:
            if self._stiffness is None:
                return np.array([np.nan])
            return np.concatenate([conserved_energy(stepper, forces) for stepper, forces in zip((self.coarse, self.fine), self._stiffness)])
        ledger = self.ledger()
        return np.concatenate([ledger["kinetic_energy"], ledger["strain_energy"], -ledger["external_work"], self.shadow()])

    def shadow(self):
        """Return (n,) J, -dt_s^2/8 a' M_s a: what central differences conserve beside kinetic and strain energy of linear forces. Local."""
        return np.concatenate([-(each.dt**2) / 4 * inertia_of(each, each.acceleration()) for each in (self.coarse, self.fine)])

    def state(self):
        """Return {key: Entry} of everything a continued run needs: both regions and the multipliers."""
        counted = {"interface/bond_evaluations": number(self.operator, "bond_evaluations", int, SUM)}
        return {**super().state(), **self.interface.state(), **self.operator.state(), **counted}

    def broken_in_overlap(self):
        """Return the directed bonds of this rank's fine copies to other copies that broke so far. Local."""
        return self.common_bonds.count_broken() if self.common_bonds is not None else 0

    def largest_gap(self):
        """Return (the largest displacement gap, the largest relative displacement of bonded particles of the overlap), m, on this rank. Local."""
        return self.interface.largest_gap()

    def _timed(self, name):
        return Timer(self._interface_seconds, name)
