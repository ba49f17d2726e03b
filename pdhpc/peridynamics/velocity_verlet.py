"""Velocity Verlet for one subdomain (Verlet 1967; Swope et al. 1982)."""
import time

import numpy as np

from pdhpc.kernels.motion import kinetic_energies
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.view import View
from pdhpc.state import SUM, Entry, number


class VelocityVerlet:
    """Integrate rho u'' = f(u) + b(t) with one step dt.

        v_{n+1/2} = v_n + dt/2 a_n
        u_{n+1}   = u_n + dt v_{n+1/2}
        a_{n+1}   = (f(u_{n+1}) + b(t_{n+1})) / rho
        v_{n+1}   = v_{n+1/2} + dt/2 a_{n+1}

    Prescribed components follow their motion instead. Forces are a function of (u, bond states) alone, so that a run continues from those; where the
    energy of state-based bonds decides about them, of those before the bonds of the last evaluation broke, so that forces are state too.
    """

    def __init__(self, subdomain, law, conditions, bind, dt, reaction=None):
        """conditions : Conditions; bind : function field -> what refreshes its ghosts (see InternalForces); dt : s.

        reaction : None, or what add_to(force_density) adds the force density of a constraint, N/m^3, at every evaluation.
        """
        self.subdomain, self.law, self.conditions, self.reaction = subdomain, law, conditions, reaction
        self.view = View(subdomain, law)
        self.dt, self.step = dt, 0
        self.internal = InternalForces(subdomain, law, bind)
        self.seconds = self.internal.seconds
        self.seconds["integrate"] = 0.0
        if conditions.interactions:
            self.seconds["contact"] = 0.0
        self._inverse_density = np.zeros(256)  # by block; a cell without a particle has none
        self._inverse_density[: len(law.density)] = 1.0 / law.density
        subdomain.particles.place()
        self.internal.evaluate()
        self._add_loads()
        conditions.settle(0.0)
        conditions.begin()

    @property
    def time(self):
        """Time of the current state, s."""
        return self.step * self.dt

    @property
    def parts(self):
        """The subdomains of this rank."""
        return (self.subdomain,)

    @property
    def broken(self):
        """Directed bonds of this rank that broke so far."""
        return self.internal.broken

    @property
    def bond_evaluations(self):
        """Directed bonds that this rank evaluated so far: {"body"}."""
        return {"body": self.internal.bond_evaluations}

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per step, to refresh ghosts and for interactions."""
        return self.internal.bytes_sent + sum(each.bytes_sent for each in self.conditions.interactions)

    def advance(self):
        """Do one step. Collective over neighbouring ranks."""
        self.begin()
        self.internal.evaluate()
        self.finish()

    def advance_in(self, count):
        """Do one step in about `count` pieces, as a generator: see InternalForces.pieces. Collective over neighbouring ranks."""
        self.begin()
        yield from self.internal.pieces(count)
        self.finish()

    def begin(self):
        """Take displacements to the end of the step: all that comes before its forces. Local."""
        started, before = time.perf_counter(), self.conditions.seconds
        self._kick_and_drift()
        self.step += 1
        self.conditions.start_of_step(self.dt)
        self._count(started, before)

    def finish(self):
        """Take velocities to the end of the step: all that comes after its internal forces. Collective with interactions, else local."""
        started, before = time.perf_counter(), self.conditions.seconds
        self._add_loads()
        self.conditions.work_of_new_forces(self.time, self.dt)
        self.subdomain.particles.kick(self._inverse_density, 0.5 * self.dt)
        self.conditions.settle(self.time)
        self._count(started, before)

    def _count(self, started, before):
        """Count the seconds since `started`: of contact and impactors, which had taken `before` seconds then, and the rest as integration."""
        contact = self.conditions.seconds - before
        self.seconds["integrate"] += time.perf_counter() - started - contact
        if contact:
            self.seconds["contact"] += contact

    def _kick_and_drift(self):
        """Take velocities to the half step and displacements to the next: in one pass where no motion is prescribed in between."""
        particles = self.subdomain.particles
        if not self.conditions.motions:
            particles.kick_drift(self._inverse_density, 0.5 * self.dt, self.dt)
            return
        particles.kick(self._inverse_density, 0.5 * self.dt)
        self.conditions.steer(self.time + self.dt, self.dt)
        particles.drift(self.dt)

    def _add_loads(self):
        """Add what acts beside the bonds to the force density."""
        self.conditions.add_loads(self.time, self.internal.broken)
        if self.reaction is not None:
            self.reaction.add_to(self.subdomain.particles.force_density)

    def state(self):
        """Return {key: Entry} of everything a continued run needs; after the last is set, `resume`."""
        particles = self.subdomain.particles
        entries = {name: particles.entry(getattr(particles, name)) for name in ("displacement", "velocity", "dissipated")}
        entries["bonds"] = Entry(self.subdomain.bonds.states, self.subdomain.bonds.set_states, particles.id[: particles.n_owned])
        if self._keeps_forces:
            entries["force_density"] = particles.entry(particles.force_density)
        entries.update(step=number(self, "step", int), bond_evaluations=number(self.internal, "bond_evaluations", int, SUM))
        return {**entries, **self.conditions.state()}

    @property
    def _keeps_forces(self):
        """Whether bonds that broke had a part in the state that the forces are of."""
        return hasattr(self.law.failure, "energy")

    def resume(self, keep_forces=False):
        """Bring everything that follows from the state up to date, after a state was put in. Collective over neighbours.

        keep_forces : whether force densities were put in that do not follow from it.
        """
        particles, bonds, evaluated = self.subdomain.particles, self.subdomain.bonds, self.internal.bond_evaluations
        kept = particles.owned(particles.force_density).copy(), particles.owned(particles.dissipated).copy(), bonds.states()
        particles.place()
        self.internal.evaluate()
        self._add_loads()
        if keep_forces or self._keeps_forces:  # and bonds that are about to break do so where the run goes on
            particles.put(particles.force_density, kept[0])
        particles.put(particles.dissipated, kept[1])
        bonds.set_states(kept[2])
        self.internal.broken, self.internal.bond_evaluations = int((bonds.initial_size - bonds.alive()).sum()), evaluated

    def acceleration(self):
        """Return (n_owned, dim) m/s^2, of the forces at hand; 0 where a motion is prescribed. Local."""
        particles = self.subdomain.particles
        acceleration = particles.force_density[particles.slots] / self.law.density[particles.owned(particles.block)][:, None]
        for motion in self.conditions.motions:
            by_slot = np.zeros(len(particles.position), bool)
            by_slot[motion.indices] = True
            acceleration[np.ix_(by_slot[particles.slots], motion.components)] = 0.0
        return acceleration

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Local."""
        particles = self.subdomain.particles
        kinetic = np.empty(particles.n_owned)
        kinetic_energies(particles.velocity, particles.volume, particles.block, self.law.density, particles.slots, kinetic)
        if particles.mass_share is not None:
            kinetic *= particles.mass_share[particles.slots]
        strain = strain_energy_density(self.subdomain, self.law)
        strain *= particles.owned(particles.volume)
        dissipated = particles.owned(particles.dissipated)
        if particles.mass_share is not None:
            mine = particles.mass_share[particles.slots] > 0.0  # copies that move as they are told have no energy of their own
            strain, dissipated = strain * mine, dissipated * mine
        ledger = {
            "kinetic_energy": kinetic,
            "strain_energy": strain,
            "dissipated_energy": dissipated,
            "external_work": self.conditions.external_work(),
        }
        for each in self.conditions.interactions:
            for name, values in each.ledger().items():
                ledger[name] = np.concatenate([ledger[name], values]) if name in ledger else values
        return ledger
