"""The Galerkin scheme: the local run gives the space, all coefficients are solved for, and functions are enriched only where the run says what they cannot.

    u^{n+1} - u^n in {phi_i, phi_j (U - u^n)},   v^{n+1} in {phi_i, phi_j V},   j chosen of J by component, see enrichment.py

    1. (rho (u^{n+1} - u^n), psi) = (dt rho v^n + I2 + dt^2/2 b, psi) + dt^2/2 r(d^n),      d += the coefficients of phi_i
    2. (rho v^{n+1}, psi)         = (rho v^n + I1 + dt b, psi) + dt/2 (r(d^n) + r(d^{n+1})),  d' = those of phi_i

for all psi of the space; alpha is 1 on enriched cells, so that elements and their forces r meet standard functions alone. Masses outside these are lumped.
"""
import numpy as np

from pdhpc.gfem.point_state import PointState


class Galerkin:
    """Scheme "galerkin" of a coupled step.

    Attributes
    ----------
    mass : EnrichedSpace, of velocities between steps. state : PointState. enriched : [(dim,) functions enriched on this rank] of displacements and velocities.
    lost : J, kinetic energy that projections of the velocity have lost so far in whole patches of this rank.
    """

    name = "galerkin"

    def __init__(self, solution, local, space, dt, k, tolerance=0.02):
        """solution : MeshSolution. local : LocalParticles. space : EnrichedSpace. dt, s, of k sub-steps. tolerance : of the patch residual."""
        self.solution, self.local, self.mass, self.dt, self.k, self.tolerance = solution, local, space, dt, k, tolerance
        self.state, self.enriched, self.lost = None, [np.zeros(solution.mesh.dim, np.int64)] * 2, 0.0
        self._everywhere = np.ones(len(solution.mesh.points), bool)

    def weight(self, patches):
        """Return (n_vertices,), the nodal values of alpha: 1 at all vertices of enriched cells. Collective over neighbours."""
        mesh = self.solution.mesh
        weight = patches.touched(patches.enriched).astype(float)
        bound = mesh.exchange.bind(weight)  # a rank does not know all cells around its ghosts
        bound.refresh()
        bound.free()
        return weight

    def follow(self, patches):
        """Take in new patches. Collective."""
        self.mass.update(patches.chosen, self.local.points, self.solution.outside_mass)
        self.state = PointState(self.local)

    def entries(self):
        """Return {key: Entry} of what a continued run needs beside the solution: nothing. Local."""
        return {}

    def settle(self):
        """Take the particles' state as that of the global solution. Local."""
        self.state.remember()

    def reconstruct(self):
        """Return (U - u^n, V), (n, dim) each at the points, what displacements and velocities are enriched by. Local."""
        self.local.add_loads_to_sums()
        self.state.read_run()
        return self.state.increment, self.state.end_velocity

    def solve(self, eta, time):
        """Find u^{n+1} and v^{n+1} in the spaces of eta. Collective. time : t_n, s."""
        increment, velocity = eta
        self._find_displacement(increment, time)
        before = self.solution.force.copy()
        self.solution.evaluate(time + self.dt)
        self._find_velocity(velocity, before, time + self.dt)
        self.state.remember()

    def _find_displacement(self, eta, time):
        """Step 1."""
        solution, state, dt = self.solution, self.state, self.dt
        np.multiply(solution.force, 0.5 * dt * dt, out=solution.right)
        state.gather_displacement_momentum(dt, solution.mesh.cells, solution.right)
        solution.gather_right()
        self._choose(eta, 0)
        found = self._project(dt)
        self._move(found.field, time)

    def _move(self, increment, time):
        """Add the increment (n, dim) to the displacement of the points, `change` to that of the vertices. Collective over neighbours. time : t_n, s."""
        solution, state, dt = self.solution, self.state, self.dt
        solution.steer(time, dt)
        solution.refresh_change()
        solution.account(time + dt, dt)
        solution.displacement += solution.change
        increment += state.displacement
        state.put(increment, None)
        self.local.refresh()

    def _find_velocity(self, eta, before, time):
        """Step 2; before : the forces of elements at the start of the step."""
        solution, state, dt = self.solution, self.state, self.dt
        np.add(before, solution.force, out=solution.right)
        solution.right *= 0.5 * dt
        state.gather_velocity_momentum(solution.mesh.cells, solution.right)
        solution.gather_right()
        solution.account_motions(dt)
        self._choose(eta, 1)
        found = self._project(1.0)
        self.lost += self.mass.lost_energy(state.momentum, found)
        self._accept(found.field, time)

    def _accept(self, velocity, time):
        """Take velocity (n, dim) as that of the points, `change` as that of the vertices. Collective over neighbours. time : t_{n+1}, s."""
        solution = self.solution
        solution.settle_motions(time)
        solution.refresh_change()
        self.state.put(None, velocity)
        solution.accept_velocity(self._everywhere, self.dt)

    def _choose(self, eta, field):
        """Enrich displacements (field 0) or velocities (1) by eta (n, dim). Collective."""
        self.mass.select(eta, self.tolerance)
        self.enriched[field] = self.mass.enriched_functions

    def _project(self, factor):
        """Return the Solution whose right side is `right` + factor m v, m the lumped mass outside; its nodal part in `change`. Collective."""
        solution, n = self.solution, self.solution.mesh.n_owned
        solution.right[:n] += factor * solution.outside_mass[:n, None] * solution.velocity[:n]
        found = self.mass.solve(solution.right, self.state.momentum)
        solution.change[...] = found.nodes
        return found
