"""Velocity Verlet for one subdomain (Verlet 1967; Swope et al. 1982)."""
import time

import numpy as np

from pdhpc.kernels.cloud import bond_forces
from pdhpc.kernels.motion import drift, kick
from pdhpc.peridynamics.fields import strain_energy_density


class VelocityVerlet:
    """Integrate rho u'' = f(u) + b(t) with one step dt.

        v_{n+1/2} = v_n + dt/2 a_n
        u_{n+1}   = u_n + dt v_{n+1/2}
        a_{n+1}   = (f(u_{n+1}) + b(t_{n+1})) / rho
        v_{n+1}   = v_{n+1/2} + dt/2 a_{n+1}

    Prescribed components follow their motion instead. Forces are a function of (u, bond states) alone, so that a run continues from those.
    """

    def __init__(self, subdomain, law, conditions, ghosts, dt):
        """conditions : Conditions; ghosts : what refreshes the ghosts of `particles.position` (start_refresh, finish_refresh); dt : s."""
        self.subdomain, self.law, self.conditions, self.ghosts = subdomain, law, conditions, ghosts
        self.dt, self.step, self.broken = dt, 0, 0
        self.seconds = {"force": 0.0, "exchange": 0.0, "integrate": 0.0}
        particles = subdomain.particles
        self._inverse_density = 1.0 / law.density
        self._rows = (0, particles.n_owned)
        particles.place()
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
        self._kick()
        self.conditions.steer(self.time + self.dt, self.dt)
        self._drift()
        self.step += 1
        self.conditions.work_of_old_forces(self.dt)
        self.seconds["integrate"] += time.perf_counter() - started
        self._evaluate_forces()
        started = time.perf_counter()
        self.conditions.work_of_new_forces(self.time, self.dt)
        self._kick()
        self.conditions.settle(self.time)
        self.seconds["integrate"] += time.perf_counter() - started

    def _kick(self):
        particles = self.subdomain.particles
        kick(particles.velocity, particles.force_density, self._inverse_density, particles.block, 0.5 * self.dt)

    def _drift(self):
        particles = self.subdomain.particles
        drift(particles.displacement, particles.velocity, particles.reference, particles.position, particles.linear, self.dt)

    def _evaluate_forces(self):
        particles, bonds = self.subdomain.particles, self.subdomain.bonds
        started = time.perf_counter()
        self.ghosts.refresh()
        refreshed = time.perf_counter()
        self.broken += bond_forces(
            self.subdomain.points, bonds.arrays, self.law, particles.linear, particles.third, self._rows, particles.force_density, particles.dissipated
        )
        self.conditions.add_loads(self.time)
        self.seconds["exchange"] += refreshed - started
        self.seconds["force"] += time.perf_counter() - refreshed

    def state(self):
        """Return {key: (getter, setter)} of everything a continued run needs."""
        particles, arrays = self.subdomain.particles, self.subdomain.bonds.arrays
        fields = {"displacement": particles.displacement, "velocity": particles.velocity, "dissipated": particles.dissipated, "alive": arrays.alive}
        state = {name: (lambda field=field: field, lambda value, field=field: np.copyto(field, value)) for name, field in fields.items()}
        state["step"] = (lambda: self.step, lambda value: setattr(self, "step", int(value)))
        state.update(self.conditions.state())
        return state

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Local."""
        particles = self.subdomain.particles
        volume = particles.volume[particles.owned]
        density = self.law.density[particles.block[particles.owned]]
        return {
            "kinetic_energy": 0.5 * density * volume * np.einsum("nd,nd->n", particles.velocity, particles.velocity),
            "strain_energy": volume * strain_energy_density(self.subdomain, self.law),
            "dissipated_energy": particles.dissipated,
            "external_work": self.conditions.external_work(),
        }
