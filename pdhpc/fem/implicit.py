"""What static and implicit steps share: fields, equilibrium with prescribed components, the work of loads and supports, the ledger."""
import time

import numpy as np

from pdhpc import state


class Implicit:
    """A stepper whose steps solve linear systems with the stiffness of a mesh.

    External forces P are the loads at free components and what the supports need, K u + M a, at prescribed ones; over a step they
    do the work (P + P') . du / 2.

    Attributes
    ----------
    body : Elasticity. nodes : Nodes with body.width unknowns, slots in the order of vertices (grid=False). conditions : NodalConditions. dt, step, time.
    stiffness : VertexMatrix. iterations : of the KSP in all steps so far. seconds : {"assemble", "force", "exchange", "wait", "integrate"}; force is the KSP.
    """

    broken, bytes_sent = 0, 0

    def __init__(self, body, nodes, conditions, dt):
        """Local."""
        self.body, self.nodes, self.conditions, self.dt, self.step = body, nodes, conditions, dt, 0
        self.seconds = dict.fromkeys(("assemble", "force", "exchange", "wait", "integrate"), 0.0)
        self.fixed, self.iterations = nodes.owned(conditions.constrained()), 0
        self._work, self._applied = np.zeros((nodes.n_owned, 1)), np.zeros((nodes.n_owned, nodes.width))

    @property
    def time(self):
        """Time of the current state, s."""
        return self.step * self.dt

    @property
    def bond_evaluations(self):
        """There are no bonds: {}."""
        return {}

    def advance(self):
        """Do one step. Collective over the mesh's ranks.

        Raises
        ------
        SolverError: a KSP diverged.
        """
        started = time.perf_counter()
        solving = self.seconds["force"]
        self._advance(self.time + self.dt)
        self.step += 1
        self.seconds["integrate"] += time.perf_counter() - started - (self.seconds["force"] - solving)

    def _solve(self, solver, right, given):
        """Return the owned rows of a solution; see ConstrainedSolver.solve."""
        started = time.perf_counter()
        x = solver.solve(right, given)
        self.iterations += solver.solver.iterations
        self.seconds["force"] += time.perf_counter() - started
        return x[: self.nodes.n_owned].copy()

    def _targets(self, t):
        """Return (n_owned, width): displacements at t, m, of prescribed components, the present ones elsewhere."""
        nodes, before = self.nodes, self.nodes.velocity.copy()
        nodes.velocity[...] = 0.0
        self.conditions.steer(t, self.dt)
        targets = nodes.owned(nodes.displacement) + self.dt * nodes.owned(nodes.velocity)
        nodes.velocity[...] = before
        return targets

    def _loads(self, t):
        """Return (n_owned, width), N, the loads at t."""
        self.nodes.force[...] = 0.0
        self.conditions.add_loads(t)
        return self.nodes.owned(self.nodes.force)

    def _account(self, loads, inner, increment):
        """Take P of the new state, loads at free components and `inner` = K u + M a at others, and the work over the increment du, m; all (n_owned, width)."""
        applied = np.where(self.fixed, inner, loads)
        self._work[:, 0] += 0.5 * ((self._applied + applied) * increment).sum(axis=1)
        self._applied[...] = applied

    def state(self):
        """Return {key: Entry} of everything a continued run needs; after the last is set, `resume`."""
        entries = {name: self.nodes.entry(getattr(self.nodes, name)) for name in ("displacement", "velocity")}
        entries.update(work=state.rows(self._work, self.nodes.ids), applied=state.rows(self._applied, self.nodes.ids))
        return {**entries, "step": state.number(self, "step", int), "iterations": state.number(self, "iterations", int)}

    def resume(self):
        """Nothing follows from the state. Local."""

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Collective over neighbouring ranks.

        Those of strain and motion are u_i . (K u)_i / 2 and v_i . (M v)_i / 2 by vertex i: only their sums have a meaning.
        """
        nodes, mass = self.nodes, getattr(self, "mass", None)
        kinetic = np.zeros(nodes.n_owned)
        if mass is not None:
            kinetic = 0.5 * (nodes.owned(nodes.velocity) * mass.multiply(refreshed(nodes, nodes.velocity))).sum(axis=1)
        strain = 0.5 * (nodes.owned(nodes.displacement) * self.stiffness.multiply(refreshed(nodes, nodes.displacement))).sum(axis=1)
        return {"kinetic_energy": kinetic, "strain_energy": strain, "dissipated_energy": np.zeros(nodes.n_owned), "external_work": self._work[:, 0].copy()}


def refreshed(nodes, field):
    """Return (n_vertices, width): a field by slot, ghosts brought up to date there too. Collective over neighbouring ranks."""
    bound = nodes.exchange.bind(field)
    bound.refresh()
    bound.free()
    return nodes.local(field)
