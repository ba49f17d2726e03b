"""Explicit integration of a mesh with lumped masses: velocity Verlet, which is central differences."""
import time

import numpy as np

from pdhpc.fem.internal_forces import InternalForces
from pdhpc.kernels.motion import drift_by_mass, kick_by_mass, kick_drift_by_mass
from pdhpc.state import number


class Explicit:
    """Integrate M u'' = F(t) - K u with one step dt.

        v_{n+1/2} = v_n + dt/2 a_n;  u_{n+1} = u_n + dt v_{n+1/2};  a_{n+1} = M^-1 (F(t_{n+1}) - K u_{n+1});  v_{n+1} = v_{n+1/2} + dt/2 a_{n+1}

    Prescribed components follow their motion instead. Results have the same bits on any number of ranks. What a body without prescribed motion conserves is its
    energy less dt^2/8 a . M a, so the balance closes to order dt^2.
    """

    broken = 0
    """Nothing breaks in a mesh."""

    def __init__(self, nodes, sweep, conditions, dt):
        """Start from the nodes' displacement and velocity. Collective over neighbouring ranks.

        nodes : Nodes with masses (see set_mass). sweep : of make_sweep. conditions : NodalConditions. dt : s; whether it is stable is the caller's to see to.
        """
        self.nodes, self.conditions, self.dt, self.step = nodes, conditions, dt, 0
        self.internal = InternalForces(nodes, sweep)
        self.seconds = self.internal.seconds
        self.seconds["integrate"] = 0.0
        self._inverse_mass = np.zeros(nodes.n_slots)
        self._inverse_mass[nodes.owned_slots] = 1.0 / nodes.mass[nodes.owned_slots]
        self._flat = [each.T for each in (nodes.velocity, nodes.force, nodes.displacement)]
        self._internal_force = nodes.new_field()
        self.resume()
        conditions.settle(0.0)
        conditions.begin()

    @property
    def time(self):
        """Time of the current state, s."""
        return self.step * self.dt

    @property
    def bond_evaluations(self):
        """There are no bonds: {}."""
        return {}

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per step to refresh ghosts."""
        return self.internal.bytes_sent

    def resume(self):
        """Bring the forces up to date with displacements and time, after a state was put in. Collective over neighbouring ranks."""
        self.internal.evaluate()
        self.conditions.add_loads(self.time)

    def advance(self):
        """Do one step. Collective over neighbouring ranks."""
        self.begin()
        self.internal.evaluate()
        self.finish()

    def begin(self):
        """Take displacements to the end of the step: all that comes before its forces. Local."""
        started = time.perf_counter()
        velocity, force, displacement = self._flat
        if not self.conditions.motions:
            kick_drift_by_mass(velocity, force, self._inverse_mass, displacement, 0.5 * self.dt, self.dt)
        else:
            kick_by_mass(velocity, force, self._inverse_mass, 0.5 * self.dt)
            self.conditions.steer(self.time + self.dt, self.dt)
            drift_by_mass(displacement, velocity, self.dt)
        self.step += 1
        self.conditions.work_of_old_forces(self.dt)
        self.seconds["integrate"] += time.perf_counter() - started

    def finish(self):
        """Take velocities to the end of the step: all that comes after its internal forces. Local."""
        started = time.perf_counter()
        velocity, force, _ = self._flat
        self.conditions.add_loads(self.time)
        self.conditions.work_of_new_forces(self.time, self.dt)
        kick_by_mass(velocity, force, self._inverse_mass, 0.5 * self.dt)
        self.conditions.settle(self.time)
        self.seconds["integrate"] += time.perf_counter() - started

    def state(self):
        """Return {key: Entry} of everything a continued run needs; after the last is set, `resume`."""
        entries = {name: self.nodes.entry(getattr(self.nodes, name)) for name in ("displacement", "velocity")}
        return {**entries, "step": number(self, "step", int), **self.conditions.state()}

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Local.

        That of strain is u_i . (K u)_i / 2 by vertex i: only its sum has a meaning.
        """
        nodes = self.nodes
        self.internal.sweep.inner(nodes.displacement, self._internal_force)  # ghosts are fresh: a step ends with its forces
        self.internal.sweep.border(nodes.displacement, self._internal_force)
        velocity, mass = nodes.owned(nodes.velocity), nodes.owned(nodes.mass)
        return {
            "kinetic_energy": 0.5 * mass * np.square(velocity).sum(axis=1),
            "strain_energy": -0.5 * (nodes.owned(nodes.displacement) * nodes.owned(self._internal_force)).sum(axis=1),
            "dissipated_energy": np.zeros(nodes.n_owned),
            "external_work": self.conditions.external_work(),
        }
