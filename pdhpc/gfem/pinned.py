"""The production scheme: the coefficient of the enrichment is one, all standard functions fade out where it fades in, and no system is solved.

    u^h = alpha U + (1 - alpha) sum_i phi_i a_i,   F^alpha_p = sum_q (alpha_p + alpha_q)/2 f_pq, summed over the sub-steps of the local run: I1 = impulse,
    I2 = its moment;   M = ((1 - alpha) rho phi_i, phi_j) on the ramp, lumped outside;   D = M lumped by row sums everywhere

    1. c = dt d' + D^-1 (b1 - dt M d'),   b1 = (dt rho v^n + I2 + dt^2/2 b - rho alpha (U - u^n), phi) + dt^2/2 r(d^n)
       u^{n+1} = u^n + alpha (U - u^n) + (1 - alpha) N c,   d_i += c_i  (i not in J)
    2. e = d' + D^-1 (b2 - M d'),         b2 = (rho v^n + I1 + dt b - rho alpha V, phi) + dt/2 (r(d^n) + r(d^{n+1}))
       v^{n+1} = alpha V + (1 - alpha) N e,   d' = e

D in the place of M conserves momentum, for sum_i D_i e_i is that of (1 - alpha) N e, and damps what N e cannot follow, since D - M is not negative. Solved with
M, or with functions that do not fade, a crack that stands still gains energy after some hundred steps.

Where alpha is 1 within the reach of bonds, the local run's own identities I1 + dt b = rho (V - v^n) and I2 + dt^2/2 b = rho (U - u^n - dt v^n) make the right
sides vanish: only the rows of Blended particles are projected.
"""
import numpy as np

from pdhpc.gfem import lanes
from pdhpc.gfem.vertex_means import VertexMeans
from pdhpc.jit import kernel


class Pinned:
    """Scheme "pinned" of a coupled step.

    Attributes
    ----------
    mass : RampMass. enriched : [(dim,) functions enriched on this rank] of displacements and velocities: all of J. lost : kinetic energy lost in projections.
    """

    name = "pinned"
    lost = 0.0  # J: nothing is projected where alpha = 1

    def __init__(self, solution, local, mass, dt, k):
        """solution : MeshSolution. local : LocalParticles. mass : RampMass. dt, s, of k sub-steps."""
        self.solution, self.local, self.mass, self.dt, self.k = solution, local, mass, dt, k
        self._old_force = np.zeros_like(solution.force)

    def weight(self, patches):
        """Return (n_vertices,), the nodal values of alpha: 1 in J."""
        return patches.chosen.astype(float)

    def follow(self, patches):
        """Take in new patches. Collective."""
        solution, mesh = self.solution, self.solution.mesh
        self.mass.follow(self.local, solution.outside_mass)
        owned = slice(mesh.n_owned)
        self._standard = ~patches.chosen
        self.enriched = [np.full(mesh.dim, int(patches.chosen[owned].sum()))] * 2
        mixed = patches.touched(patches.enriched & ~patches.whole)
        self._means = VertexMeans(self.local.lattice, self.local.subdomain, np.flatnonzero((mixed & patches.chosen)[owned]))
        self.settle()

    def entries(self):
        """Return {key: Entry} of what a continued run needs beside the solution: nothing. Local."""
        return {}

    def settle(self):
        """Bring what follows from the particles, nodal means in J and forces of elements, up to date. Collective over neighbours."""
        self._means.store(self.local.subdomain.particles.position, self.solution.displacement)
        self.solution.refresh("displacement")

    def reconstruct(self):
        """Take the local run as it is: eta = U - u^n for displacements, V for velocities, both at the particles, with the coefficient 1. Local."""
        local = self.local
        local.add_loads_to_sums()
        return local.subdomain.particles.position, local.subdomain.particles.velocity

    def solve(self, eta, time):
        """Find u^{n+1} and v^{n+1} from the local run eta = (U, V). Collective. time : t_n, s."""
        solution, (position, velocity) = self.solution, eta
        self._find_displacement(position, time)
        np.copyto(self._old_force, solution.force)
        solution.evaluate(time + self.dt)
        self._find_velocity(velocity, time + self.dt)

    def _find_displacement(self, position, time):
        """Step 1."""
        solution, blended, mesh, dt = self.solution, self.local.blended, self.solution.mesh, self.dt
        right = solution.right
        np.multiply(solution.force, 0.5 * dt * dt, out=right)
        lanes.project_displacement(blended.rows, blended.cell, blended.number, blended.table, blended.alpha, blended.inside, blended.before,
                                   blended.velocity_before, blended.moment, position, blended.density, dt, self.local.volume, mesh.cells, self.mass.acting, right)
        self.mass.take_out(dt, solution.velocity, right)
        solution.gather_right()
        self.mass.divide(dt, solution.velocity, right, solution.change)
        solution.steer(time, dt)
        solution.refresh_change()
        solution.account(time + dt, dt)
        add_where(self._standard, solution.change, solution.displacement)
        lanes.blend_state(blended.rows, blended.inside, blended.alpha, blended.before, position, self.local.subdomain.particles.velocity, False)
        self.mass.add_to_points(solution.change, position)
        self.local.refresh()
        self.settle()

    def _find_velocity(self, velocity, time):
        """Step 2."""
        solution, blended, mesh, dt = self.solution, self.local.blended, self.solution.mesh, self.dt
        right = solution.right
        np.add(self._old_force, solution.force, out=right)
        right *= 0.5 * dt
        lanes.project_velocity(blended.rows, blended.cell, blended.number, blended.table, blended.alpha, blended.inside, blended.velocity_before,
                               blended.impulse, velocity, blended.density, self.local.volume, mesh.cells, self.mass.acting, right)
        self.mass.take_out(1.0, solution.velocity, right)
        solution.gather_right()
        solution.account_motions(dt)
        self.mass.divide(1.0, solution.velocity, right, solution.change)
        solution.settle_motions(time)
        solution.refresh_change()
        lanes.blend_state(blended.rows, blended.inside, blended.alpha, blended.before, self.local.subdomain.particles.position, velocity, True)
        self.mass.add_to_points(solution.change, velocity)
        solution.accept_velocity(self.mass.acting, dt)


@kernel
def add_where(chosen, source, target):
    """target[chosen] += source[chosen]; chosen (n,) bool, source, target (n, dim)."""
    for n in range(len(chosen)):
        if chosen[n]:
            for d in range(source.shape[1]):
                target[n, d] += source[n, d]
