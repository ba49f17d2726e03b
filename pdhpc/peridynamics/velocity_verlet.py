"""Velocity Verlet for one subdomain (Verlet 1967; Swope et al. 1982)."""
import time

import numpy as np

from pdhpc.kernels.motion import kinetic_energies
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.peridynamics.internal_forces import InternalForces


class VelocityVerlet:
    """Integrate rho u'' = f(u) + b(t) with one step dt.

        v_{n+1/2} = v_n + dt/2 a_n
        u_{n+1}   = u_n + dt v_{n+1/2}
        a_{n+1}   = (f(u_{n+1}) + b(t_{n+1})) / rho
        v_{n+1}   = v_{n+1/2} + dt/2 a_{n+1}

    Prescribed components follow their motion instead. Forces are a function of (u, bond states) alone, so that a run continues from those.
    """

    def __init__(self, subdomain, law, conditions, bind, dt):
        """conditions : Conditions; bind : function field -> what refreshes its ghosts (see InternalForces); dt : s."""
        self.subdomain, self.law, self.conditions = subdomain, law, conditions
        self.dt, self.step, self.broken = dt, 0, 0
        self.internal = InternalForces(subdomain, law, bind)
        self.seconds = self.internal.seconds
        self.seconds["integrate"] = 0.0
        self._inverse_density = np.zeros(256)  # by block; a cell without a particle has none
        self._inverse_density[: len(law.density)] = 1.0 / law.density
        subdomain.particles.place()
        self._evaluate_forces()
        conditions.settle(0.0)
        conditions.begin()

    @property
    def time(self):
        """Time of the current state, s."""
        return self.step * self.dt

    def advance(self):
        """Do one step. Collective over neighbouring ranks."""
        started = time.perf_counter()
        self._kick_and_drift()
        self.step += 1
        self.conditions.work_of_old_forces(self.dt)
        self.seconds["integrate"] += time.perf_counter() - started
        self._evaluate_forces()
        started = time.perf_counter()
        self.conditions.work_of_new_forces(self.time, self.dt)
        self.subdomain.particles.kick(self._inverse_density, 0.5 * self.dt)
        self.conditions.settle(self.time)
        self.seconds["integrate"] += time.perf_counter() - started

    def _kick_and_drift(self):
        """Take velocities to the half step and displacements to the next: in one pass where no motion is prescribed in between."""
        particles = self.subdomain.particles
        if not self.conditions.motions:
            particles.kick_drift(self._inverse_density, 0.5 * self.dt, self.dt)
            return
        particles.kick(self._inverse_density, 0.5 * self.dt)
        self.conditions.steer(self.time + self.dt, self.dt)
        particles.drift(self.dt)

    def _evaluate_forces(self):
        self.broken += self.internal.evaluate()
        started = time.perf_counter()
        self.conditions.add_loads(self.time)
        self.seconds["integrate"] += time.perf_counter() - started

    def state(self):
        """Return {key: (getter, setter)} of everything a continued run needs, arrays of owned particles in ascending id."""
        particles, arrays = self.subdomain.particles, self.subdomain.bonds.arrays
        state = {name: _rows(particles, getattr(particles, name)) for name in ("displacement", "velocity", "dissipated")}
        state["alive"] = (lambda: arrays.alive, lambda value: np.copyto(arrays.alive, value))
        state["step"] = (lambda: self.step, lambda value: setattr(self, "step", int(value)))
        state.update(self.conditions.state())
        return state

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Local."""
        particles = self.subdomain.particles
        kinetic = np.empty(particles.n_owned)
        kinetic_energies(particles.velocity, particles.volume, particles.block, self.law.density, particles.slots, kinetic)
        strain = strain_energy_density(self.subdomain, self.law)
        strain *= particles.owned(particles.volume)
        return {
            "kinetic_energy": kinetic,
            "strain_energy": strain,
            "dissipated_energy": particles.owned(particles.dissipated),
            "external_work": self.conditions.external_work(),
        }


def _rows(particles, field):
    """Return (getter, setter) of the owned rows of a field by slot."""

    def put(value):
        field[particles.slots] = value

    return lambda: particles.owned(field), put
