"""Load stepping: a body brought from one equilibrium to the next, with bonds that break in between."""
import math
import time
from typing import NamedTuple

import numpy as np

from pdhpc import state
from pdhpc.kernels import balance
from pdhpc.kernels import tangent as loops
from pdhpc.parallel.linear_solver import SolverError
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.tangent import stiffness_blocks, unbreakable
from pdhpc.peridynamics.view import View

_NEARLY = 0.99  # of the largest s/s0: bonds above it count as most strained too, so that mirror images break together
_ROUGHEST = 0.01  # residual that counts as an equilibrium where rounding allows no better
_ROUNDING = 4.0 * np.finfo(float).eps


class LoadPath(NamedTuple):
    """How loads are stepped.

    dt : s, of a load step. tolerance : of the relative residual. iterations : most in an equilibrium. one_by_one : break the most strained bonds alone.
    equilibria : most in a load step. spacing : m, of the particles; length : of them, along the body's longest side.
    """

    dt: float
    tolerance: float
    iterations: int
    one_by_one: bool
    equilibria: int
    spacing: float
    length: int


class Equilibrium:
    """What both ways to equilibrium share: a step takes loads and prescribed displacements to t + dt and the body to rest; then bonds break, until none does.

        residual = |V (f + b)|_free / max(|V b|_free, |V (f + b)|_held),

    Euclidean norms over the components of all particles; f of the bonds, b of the loads; the divisor is the largest of the run so far. The body is unloaded
    before the first step. Bonds do not break while the body is brought to rest. Energy that leaves when it comes to rest after bonds broke, which a moving
    body would radiate, counts as dissipated with what the bonds themselves release: `damped`, U + W - U' - released, J.

    Attributes
    ----------
    dt, step, time : s. residual, iterations, ksp_iterations, equilibria, broken_in_step : of the last load step (residual: at its end).
    torn : whether the last load step found no equilibrium. totals : {name: of all load steps so far}. changed : whether bonds broke since `prepare`.
    """

    def __init__(self, subdomain, law, conditions, bind, sums, path):
        """conditions : ParticleConditions. bind : function field -> what refreshes its ghosts. sums : Sums. path : LoadPath."""
        self.subdomain, self.law, self.conditions, self.sums, self.path = subdomain, law, conditions, sums, path
        self.view = View(subdomain, law)
        self.dt, self.step, self.torn = path.dt, 0, False
        self.whole = unbreakable(subdomain, law)
        self.internal, self._breaking = InternalForces(*self.whole, bind), InternalForces(subdomain, law, bind)
        self.seconds = self._breaking.seconds = self.internal.seconds
        self.seconds.update(integrate=0.0, solve=0.0)
        particles = subdomain.particles
        shape = (particles.n_owned, particles.dim)
        self.held, self.loads = conditions.held(), np.zeros(shape)
        self._squares = np.empty((3, particles.n_owned))
        self._before, self._applied = np.zeros(shape), np.zeros(shape)
        self._work, self._damped, self._segment = (np.zeros(particles.n_owned) for _ in range(3))
        self.totals, self.changed = {"iterations": 0, "ksp_iterations": 0, "equilibria": 0, "largest_residual": 0.0, "rounding_residual": 0.0}, True
        self.reference = self.residual = self._out = 0.0
        self.iterations = self.ksp_iterations = self.equilibria = self.broken_in_step = 0
        particles.place()
        self.evaluate()
        self._rounding = self._rounding_force()
        self._energy, self._released = self._energies(), particles.owned(particles.dissipated).copy()
        self._before[...] = particles.owned(particles.displacement)

    @property
    def time(self):
        """Load parameter of the current state, s."""
        return self.step * self.dt

    @property
    def parts(self):
        """The subdomains of this rank."""
        return (self.subdomain,)

    @property
    def broken(self):
        """Directed bonds of this rank that broke so far."""
        return self._breaking.broken

    @property
    def bond_evaluations(self):
        """Directed bonds that this rank evaluated so far: {"body"}."""
        return {"body": self.internal.bond_evaluations + self._breaking.bond_evaluations}

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per evaluation of forces to refresh ghosts."""
        return self.internal.bytes_sent

    @property
    def note(self):
        """What progress says of the last load step."""
        broke = f", {self.broken_in_step:,} bonds broke in {self.equilibria} equilibria" if self.broken_in_step else ""
        return f"residual {self.residual:.1e} in {self.iterations:,} iterations{broke}"

    def advance(self):
        """Do one load step. Collective.

        Raises
        ------
        SolverError, on every rank: no equilibrium within path.iterations, or bonds that break in each of path.equilibria; the state is then that of this
        load step, out of balance, and `torn` is set.
        """
        try:
            self._advance()
        except SolverError:
            self.torn = True
            self.evaluate()
            self.step += 1
            raise
        self.step += 1

    def _advance(self):
        """Find the equilibria of a load step, until no bond breaks. Collective."""
        self.iterations = self.ksp_iterations = self.equilibria = self.broken_in_step = 0
        t, after_break = (self.step + 1) * self.dt, False
        self._find_loads(t)
        if self.changed:
            self.prepare()
            self.changed = False
        while True:
            self.bring_to_rest(t, after_break)
            self.equilibria += 1
            self._account(after_break)
            broke = self._break_bonds()
            if broke == 0:
                break
            self.broken_in_step, self.changed = self.broken_in_step + broke, True
            if self.equilibria >= self.path.equilibria:
                raise SolverError(f"{self.where(t)}: bonds break in each of {self.equilibria} equilibria, {self.broken_in_step:,} so far and {broke:,} in the last: the body fails in"
                                  " this step; raise static.equilibria, or end there")
            after_break = True
        self.evaluate()
        for name in ("iterations", "ksp_iterations", "equilibria"):
            self.totals[name] += getattr(self, name)
        if self.residual > self.path.tolerance:
            self.totals["rounding_residual"] = max(self.totals["rounding_residual"], self.residual)
        self.totals["largest_residual"] = max(self.totals["largest_residual"], self.residual)

    def prepare(self):
        """Make what depends on the bonds that are left; it serves until the end of the load step, in which they only become fewer. Collective."""
        raise NotImplementedError

    def bring_to_rest(self, t, after_break):
        """Find the equilibrium at t from the present state; after_break : at the same loads as the last one. Collective."""
        raise NotImplementedError

    def where(self, t):
        """Return the words that say which load step this is."""
        return f"load step {self.step + 1} (t = {t:.6g} s)"

    def motion_of_supports(self, t):
        """Return ((n_owned, dim) m, whether any of it on any rank is not 0): what supports have to move to where they must be at t; displacements stay. Collective."""
        particles = self.subdomain.particles
        before = particles.owned(particles.displacement).copy()
        self.conditions.place(t)
        motion = particles.owned(particles.displacement) - before
        particles.put(particles.displacement, before)
        return motion, self.sums.largest(float(np.abs(motion).max(initial=0.0))) > 0.0

    def _find_loads(self, t):
        """Store the force densities of loads at t."""
        particles = self.subdomain.particles
        particles.force_density[...] = 0.0
        self.conditions.add_loads(t)
        self.loads[...] = particles.owned(particles.force_density)

    def evaluate(self):
        """Set total force densities at the present displacements. Collective over neighbours."""
        self.internal.evaluate()
        started = time.perf_counter()
        particles = self.subdomain.particles
        balance.add_loads(particles.force_density, self.loads, particles.slots)
        self.seconds["integrate"] += time.perf_counter() - started

    def measure(self):
        """Return what is out of balance, N, from the force densities at hand; sets `residual` and `reference`. Collective."""
        particles = self.subdomain.particles
        balance.square_forces(particles.force_density, self.loads, self.held, particles.volume, particles.slots, self._squares)
        free, applied, reaction = self.sums.of(self._squares)
        if math.isfinite(free + applied + reaction):
            self.reference = max(self.reference, math.sqrt(applied), math.sqrt(reaction))
        out = math.sqrt(free) if free >= 0.0 else math.nan
        if out <= self._rounding and self.reference <= self._rounding and applied == 0.0 and self.sums.largest(np.abs(particles.displacement).max(initial=0.0)) == 0.0:
            self.residual = 0.0  # nothing is loaded, nothing has moved
        else:
            self.residual = out / self.reference if self.reference > 0.0 else 0.0 if out == 0.0 else out * math.inf
        self._out = out
        return out

    def at_rest(self, stalled):
        """Whether the body is in balance as well as can be: to the tolerance, or, where iterations come no closer, to the rounding of positions. Local."""
        return self.residual <= self.path.tolerance or (stalled and self._out <= self._rounding and self.residual <= _ROUGHEST)

    def _rounding_force(self):
        """Return the force, N, that may be out of balance however long one iterates: of positions wrong by their rounding; 0 in linear kinematics. Collective."""
        particles, path = self.subdomain.particles, self.path
        if particles.linear:
            return 0.0
        force = np.trace(stiffness_blocks(*self.whole), axis1=1, axis2=2) * particles.owned(particles.volume) * path.spacing
        return _ROUNDING * path.length * math.sqrt(self.sums.of(np.square(force).reshape(1, -1))[0])

    def failed(self, t, iterations, why):
        """Return the SolverError of an equilibrium that was not found."""
        broke = f"; {self.broken_in_step:,} bonds broke in this step" if self.broken_in_step else ""
        if self._out <= self._rounding:
            why = f'forces below {self._rounding:.3g} N are the rounding of positions; particles.kinematics = "linear" is not limited by it'
        return SolverError(f"{self.where(t)} found no equilibrium: after {iterations:,} iterations forces are out of balance by {self.residual:.3g} of {self.reference:.4g} N,"
                           f" where static.tolerance = {self.path.tolerance:g}{broke}: {why}")

    def _energies(self):
        """Return (n_owned,) J, strain energy. Local."""
        energy = strain_energy_density(self.subdomain, self.law)
        return energy * self.subdomain.particles.owned(self.subdomain.particles.volume)

    def _account(self, after_break):
        """Book the work since the last equilibrium, and what was damped when bonds broke after it. Local."""
        particles = self.subdomain.particles
        balance.add_work(
            particles.force_density, self.loads, self.held, particles.displacement, self._before, self._applied, particles.volume, particles.slots, self._segment
        )
        energy, released = self._energies(), particles.owned(particles.dissipated)
        self._work += self._segment
        if after_break:
            self._damped += self._energy + self._segment - energy - (released - self._released)
        self._energy, self._released = energy, released.copy()

    def _break_bonds(self):
        """Break bonds beyond their limit, all or the most strained; return how many bonds. Collective."""
        before, self._breaking.law = self._breaking.broken, self._limits()
        self._breaking.evaluate()
        return self.sums.count(self._breaking.broken - before) // 2

    def _limits(self):
        """Return the law whose limits decide which bonds break now. Collective."""
        if not self.path.one_by_one:
            return self.law
        domain, particles = self.subdomain, self.subdomain.particles
        most = loops.largest_stretch(domain.bonds.arrays, domain.points, self.law, particles.linear, particles.third, particles.slots)
        limit = self.law.critical_stretch * max(1.0, _NEARLY * self.sums.largest(most))
        return self.law._replace(break_at=limit if particles.linear else (1.0 + limit) ** 2)

    def state(self):
        """Return {key: Entry} of everything a continued run needs; after the last is set, `resume`."""
        particles, bonds = self.subdomain.particles, self.subdomain.bonds
        ids = particles.id[: particles.n_owned]
        entries = {name: particles.entry(getattr(particles, name)) for name in ("displacement", "dissipated")}
        entries["bonds"] = state.Entry(bonds.states, bonds.set_states, ids)
        for name in ("work", "damped", "before", "applied"):
            entries[name] = state.rows(getattr(self, f"_{name}"), ids)
        for name in ("energy", "released"):
            entries[name] = state.Entry(lambda name=name: getattr(self, f"_{name}"), lambda value, name=name: setattr(self, f"_{name}", np.array(value)), ids)
        for name, value in self.totals.items():
            entries[f"totals/{name}"] = state.item(self.totals, name, type(value))
        entries["bond_evaluations"] = state.Entry(lambda: self.bond_evaluations["body"], self._count_from, state.SUM)
        return {**entries, "step": state.number(self, "step", int), "reference": state.number(self, "reference")}

    def _count_from(self, evaluations):
        self.internal.bond_evaluations, self._breaking.bond_evaluations = int(evaluations), 0

    def resume(self):
        """Bring everything that follows from the state up to date, after a state was put in. Collective."""
        particles, bonds, evaluations = self.subdomain.particles, self.subdomain.bonds, self.bond_evaluations["body"]
        self._find_loads(self.time)
        particles.place()
        self.evaluate()
        self._count_from(evaluations)
        self.changed = True
        self._breaking.broken = int((bonds.initial_size - bonds.alive()).sum())

    def ledger(self):
        """Return {name: (n_owned,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Local."""
        return {
            "kinetic_energy": np.zeros_like(self._work),
            "strain_energy": self._energies(),
            "dissipated_energy": self.subdomain.particles.owned(self.subdomain.particles.dissipated) + self._damped,
            "external_work": self._work.copy(),
        }

    def damped(self):
        """Return (n_owned,) J, the part of the dissipated energy that no bond released. Local."""
        return self._damped
