"""Implicit dynamics: Newmark's method with average acceleration (Newmark 1959), unconditionally stable, of second order, without damping."""
import time

import numpy as np

from pdhpc.fem.implicit import Implicit, refreshed
from pdhpc.fem.vertex_matrix import ConstrainedSolver, VertexMatrix
from pdhpc.parallel.linear_solver import Defaults
from pdhpc.state import Entry

DEFAULTS = Defaults("cg", 1e-10, 500, "gamg")


class Newmark(Implicit):
    """M u'' = F(t) - K u with the consistent mass, beta = 1/4, gamma = 1/2:

        u* = u_n + dt v_n + dt^2/4 a_n,  v* = v_n + dt/2 a_n
        (M + dt^2/4 K) a_{n+1} = F(t_{n+1}) - K u*
        u_{n+1} = u* + dt^2/4 a_{n+1},  v_{n+1} = v* + dt/2 a_{n+1}

    Prescribed components have the displacement and velocity of their motion, and the difference of its velocity over the step around t as acceleration. The
    energy balance closes to the KSP's tolerance while these rest, else to order dt^2. KSP "gfem_", and "gfem_start_" for the first acceleration.
    """

    def __init__(self, body, nodes, conditions, dt, defaults=DEFAULTS):
        """Assemble the matrices and find the acceleration of the initial state. Collective over the mesh's ranks.

        body : Elasticity. nodes : Nodes(mesh, False, body.width), with the initial displacement and velocity. conditions : NodalConditions. dt : s.
        """
        super().__init__(body, nodes, conditions, dt)
        started = time.perf_counter()
        stiffness, mass = body.stiffness(), body.mass()
        parts = body.mesh, nodes.stars, body.width
        self.stiffness, self.mass = VertexMatrix(*parts, (1.0, stiffness)), VertexMatrix(*parts, (1.0, mass))
        whole = VertexMatrix(*parts, (1.0, mass), (0.25 * dt * dt, stiffness))
        self._solver = ConstrainedSolver(whole, body.basis, self.fixed, "gfem_", defaults)
        self.seconds["assemble"] += time.perf_counter() - started
        conditions.settle(0.0)
        self.acceleration = self._first_acceleration(defaults)

    def _first_acceleration(self, defaults):
        """Return (n_owned, width), m/s^2, of the initial state."""
        nodes, loads = self.nodes, self._loads(0.0)
        inner = self.stiffness.multiply(refreshed(nodes, nodes.displacement))
        solver = ConstrainedSolver(self.mass, self.body.basis, self.fixed, "gfem_start_", defaults._replace(preconditioner="jacobi"))
        acceleration = self._solve(solver, loads - inner, self._prescribed_acceleration(0.0))
        self._account(loads, inner + self._inertia(acceleration), 0.0)
        return acceleration

    def _advance(self, t):
        nodes, dt = self.nodes, self.dt
        u, v, loads = nodes.owned(nodes.displacement), nodes.owned(nodes.velocity), self._loads(t)
        prescribed = self._prescribed_acceleration(t)
        targets = self._targets(t)
        start = np.where(self.fixed, targets - 0.25 * dt * dt * prescribed, u + dt * v + 0.25 * dt * dt * self.acceleration)
        nodes.put(nodes.displacement, start)
        right = loads - self.stiffness.multiply(refreshed(nodes, nodes.displacement))
        new = self._solve(self._solver, right, prescribed)
        nodes.put(nodes.displacement, start + 0.25 * dt * dt * new)
        nodes.put(nodes.velocity, v + 0.5 * dt * (self.acceleration + new))
        self.conditions.settle(t)
        self.acceleration = new
        inner = self.stiffness.multiply(refreshed(nodes, nodes.displacement)) + self._inertia(new)
        self._account(loads, inner, nodes.owned(nodes.displacement) - u)

    def _inertia(self, acceleration):
        """Return M a (n_owned, width), N. Collective over neighbouring ranks."""
        field = self.nodes.new_field()
        self.nodes.put(field, acceleration)
        return self.mass.multiply(refreshed(self.nodes, field))

    def _prescribed_acceleration(self, t):
        """Return (n_owned, width), m/s^2, of prescribed components, 0 elsewhere."""
        field, half = self.nodes.new_field(), 0.5 * self.dt
        for motion in self.conditions.motions:
            field[np.ix_(motion.indices, motion.components)] = (motion.velocity_at(t + half) - motion.velocity_at(t - half)) / self.dt
        return self.nodes.owned(field)

    def state(self):
        """Return what Implicit.state does and the acceleration, without which the next step would begin another motion."""
        return {**super().state(), "acceleration": Entry(lambda: self.acceleration, lambda value: setattr(self, "acceleration", np.array(value)), self.nodes.ids)}
