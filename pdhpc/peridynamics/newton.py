"""Newton's method with a tangent that is never assembled."""
import time

import numpy as np

from pdhpc.parallel.linear_solver import SolverError
from pdhpc.peridynamics.equilibrium import Equilibrium
from pdhpc.peridynamics.tangent import Tangent, stiffness_blocks

_STALLED = 0.5  # of what was out of balance: a Newton step that leaves more comes no closer
_HALVINGS = 8  # of a Newton step, before it is given up
_CLOSER = 0.1  # of what is out of balance beyond the tolerance: how closely linear systems are solved for the last step
_INEXACT = 1e-4  # relative: how closely at best in finite kinematics, where the next step corrects
_FLOOR = 1e-6  # of a block's trace, added to its diagonal: a particle held by bonds along one line has a block without an inverse


class Newton(Equilibrium):
    """Find V (f(u) + b) = 0 by u <- u + s du, -V J(u) du = V (f(u) + b), J of tangent.py, with s = 1, 1/2, ... until less is out of balance.

    Supports move with the first of these steps, along which the free particles follow as the tangent says. `solver` is preconditioned by the inverse blocks of
    V A (stiffness_blocks), those of supports and of particles without bonds replaced by the identity.
    """

    def __init__(self, subdomain, law, conditions, bind, sums, path):
        """As of Equilibrium. `make_solver` is to be called before the first step."""
        super().__init__(subdomain, law, conditions, bind, sums, path)
        self.tangent, self.solver = Tangent(*self.whole, bind, sums, path.spacing), None
        self._volume = subdomain.particles.owned(subdomain.particles.volume)[:, None]

    def make_solver(self, make):
        """Let `make` (function (n_local, apply, inverse blocks) -> LinearSolver) set the KSP up. Collective."""
        self.solver = make(self.held.size, self._stiffness, self._inverse_blocks())

    def prepare(self):
        """Take blocks of the bonds that are left. Collective."""
        self.solver.precondition(self._inverse_blocks())

    def bring_to_rest(self, t, after_break):
        """As of Equilibrium. Collective."""
        particles = self.subdomain.particles
        motion, moves = self.motion_of_supports(t)
        particles.place()
        self.evaluate()
        out = self.measure()
        stalled = False
        for iteration in range(self.path.iterations):
            if not moves and self.at_rest(stalled):
                return
            before, out = out, self._step(t, motion if moves else None, out)
            stalled = not moves and out > _STALLED * before
            moves = False
            self.iterations += 1
        if not self.at_rest(stalled):
            raise self.failed(t, self.path.iterations, "take more load steps, or raise static.iterations or static.tolerance")

    def _step(self, t, motion, out):
        """Do one step, the whole of it where supports move; return what is out of balance then, N. Collective."""
        particles = self.subdomain.particles
        before = particles.owned(particles.displacement).copy()
        right = self._volume * particles.owned(particles.force_density)
        if motion is not None:
            right = right + self._volume * self._change(motion)
        du = self._solve(t, np.where(self.held, 0.0, right))
        if motion is not None:
            self._move(before + motion + du)
            return self.measure()
        size = 1.0
        for _ in range(_HALVINGS + 1):
            self._move(before + size * du)
            now = self.measure()
            if now < (1.0 - 1e-4 * size) * out or self.residual <= self.path.tolerance:
                return now
            size *= 0.5
        if out <= self._rounding:
            self._move(before)
            return self.measure()
        raise self.failed(t, self.iterations, f"a Newton step of 1/{2**_HALVINGS} brings it no closer; take more load steps, or raise static.tolerance")

    def _move(self, displacement):
        """Set displacements and evaluate forces there. Collective over neighbours."""
        particles = self.subdomain.particles
        particles.put(particles.displacement, displacement)
        particles.place()
        self.evaluate()

    def _solve(self, t, right):
        """Return du (n_owned, dim), m. Collective."""
        started, before = time.perf_counter(), self._sweeping()
        size = self.sums.of(np.square(right).reshape(1, -1))[0] ** 0.5
        wanted = _CLOSER * self.path.tolerance * (self.reference / size if 0.0 < self.reference < size else 1.0)
        self.solver.aim(max(wanted, _INEXACT) if not self.subdomain.particles.linear else wanted)
        du = self.solver.solve(right.ravel()).reshape(right.shape)
        self.ksp_iterations += self.solver.iterations
        self.seconds["solve"] += time.perf_counter() - started - (self._sweeping() - before)
        if self.solver.failure is not None:
            raise SolverError(f"{self.where(t)}: {self.solver.failure}")
        return du

    def _sweeping(self):
        """Return the seconds spent in sweeps and messages."""
        return sum(self.seconds[name] for name in ("force", "exchange", "wait"))

    def _change(self, field):
        """Return J field, (n_owned, dim) N/m^3. Collective."""
        self.tangent.apply(field, self.seconds)
        return self.tangent.change

    def _stiffness(self, x):
        """Return -V J x at free components, x times a stiffness at held ones. Collective."""
        x = x.reshape(self.held.shape)
        return np.where(self.held, self._unit * x, -self._volume * self._change(np.where(self.held, 0.0, x)))

    def _inverse_blocks(self):
        """Return (n_owned, dim, dim) m/N, inverse blocks of the stiffness; sets what stands for it at held components."""
        blocks = stiffness_blocks(*self.whole) * self._volume[:, :, None]
        dim, held = self.held.shape[1], self.held
        size = np.trace(blocks, axis1=1, axis2=2) / dim
        self._unit = self.sums.largest(size.max(initial=0.0)) or 1.0
        blocks[held[:, :, None] | held[:, None, :]] = 0.0
        diagonal = np.arange(dim)
        blocks[:, diagonal, diagonal] += np.where(held | (size == 0.0)[:, None], self._unit, _FLOOR * size[:, None])
        return np.linalg.inv(blocks)
