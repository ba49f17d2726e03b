"""Adaptive dynamic relaxation (Underwood 1983; Kilic & Madenci 2010)."""
import math
import time

import numpy as np

from pdhpc import state
from pdhpc.kernels import balance
from pdhpc.peridynamics.equilibrium import Equilibrium
from pdhpc.peridynamics.tangent import stiffness_blocks

EVERY = 10
"""Iterations between two looks at the residual, with three reductions over all ranks each; the damping coefficient takes three more."""
_MARGIN = 1.1  # on the fictitious density: bonds under tension are stiffer than those at rest
_LARGEST_DAMPING = 1.9  # per iteration
_CLOSER, _WAYS = 0.9, 8  # what comes closer leaves less than that share of the least so far, within so many times a wave's way through the body


class Relaxation(Equilibrium):
    """Bring the body to rest as D u'' + c D u' = f + b does in steps of length 1, D a density that makes every step stable:

        D_i = 1.1 |A_i|/2,   c = 2 sqrt(w . K w / w . D w),   K w = f(u_0) - f(u),  w = u - u_0.

    |A_i| is the bound that critical steps come from (critical_step.py): omega_max^2 <= 2 max |A_i|/D_i < 4. One c for all; its sums, and those of the residual,
    do not depend on the number of ranks, so that nothing does. u_0 is where the free particles stand when the supports have arrived. c is the smaller one of
    that and the same of the change over the last iterations, which shows slow motions that are left in the end.
    """

    def __init__(self, subdomain, law, conditions, bind, sums, path):
        """As of Equilibrium."""
        super().__init__(subdomain, law, conditions, bind, sums, path)
        shape = self.held.shape
        self._pace, self._increment, self._steady = np.zeros(shape), np.zeros(shape), False
        self._start, self._last = (np.zeros(shape), np.zeros(shape)), (np.zeros(shape), np.zeros(shape))  # forces and displacements
        self._parts, self.density = np.empty((2, len(self.held))), np.zeros(len(self.held))

    def bring_to_rest(self, t, after_break):
        """As of Equilibrium; after steps without breaking the path is continued in a straight line. Collective."""
        particles, path = self.subdomain.particles, self.path
        before = particles.owned(particles.displacement).copy()
        ramp = 0 if after_break else self._set_out(t)
        self._pace[...] = 0.0
        damping, best = 0.0, (math.inf, 0)
        for iteration in range(path.iterations + 1):
            if iteration < ramp:
                self.conditions.place(t, 1.0 / (ramp - iteration))
            particles.place()
            self.evaluate()
            if iteration == ramp:
                self._keep(self._start)
            since = iteration - ramp
            if since >= 0 and since % EVERY == 0:
                out = self.measure()
                if out < _CLOSER * best[0]:
                    best = out, since
                if not math.isfinite(out) or self.at_rest(since - best[1] > _WAYS * path.length):
                    break
                damping = self._damping() if since else damping
                self._keep(self._last)
            started = time.perf_counter()
            balance.relax(particles.displacement, self._pace, particles.force_density, self.density, self.held, particles.slots, damping)
            self.seconds["integrate"] += time.perf_counter() - started
        else:
            self.measure()
        self.iterations += iteration
        if not self.at_rest(True):
            raise self.failed(t, iteration, "raise static.iterations or static.tolerance, take more load steps, or look for parts that nothing holds")
        np.subtract(particles.owned(particles.displacement), before, out=self._increment)
        self._steady = not after_break

    def state(self):
        """As of Equilibrium, with the straight line that a next step continues."""
        entries = super().state()
        return {**entries, "increment": state.rows(self._increment, entries["displacement"].of), "steady": state.number(self, "_steady", bool)}

    def _set_out(self, t):
        """Continue the last increment where no bond broke in it; return the iterations that supports then take to arrive: 0, or twice a wave's way. Collective."""
        particles = self.subdomain.particles
        if not self._steady:
            return 2 * self.path.length if self.motion_of_supports(t)[1] else 0
        particles.put(particles.displacement, particles.owned(particles.displacement) + self._increment)
        self.conditions.place(t)
        return 0

    def prepare(self):
        """Set D of the bonds that are left. Local."""
        domain, law = self.whole
        blocks = stiffness_blocks(domain, law, True)
        self.density[...] = 0.5 * _MARGIN * np.abs(blocks).sum(axis=2).max(axis=1, initial=0.0)

    def _keep(self, pair):
        """Store force densities and displacements."""
        particles = self.subdomain.particles
        pair[0][...], pair[1][...] = particles.owned(particles.force_density), particles.owned(particles.displacement)

    def _damping(self):
        """Return c. Collective."""
        particles, found = self.subdomain.particles, []
        for forces, displacements in (self._start, self._last):
            balance.rayleigh_parts(
                particles.force_density, forces, particles.displacement, displacements, self.density, self.held, particles.volume, particles.slots, self._parts
            )
            stiff, heavy = self.sums.of(self._parts)
            if stiff > 0.0 and heavy > 0.0:
                found.append(stiff / heavy)
        return min(2.0 * math.sqrt(min(found)), _LARGEST_DAMPING) if found else 0.0
