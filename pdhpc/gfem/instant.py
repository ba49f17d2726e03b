"""What the coupled step is compared with: the force of the particles at the ends of a step in the place of its mean over the sub-steps.

    (rho v', psi)      = (rho v^n, psi) + dt/2 r(u^n),     u^{n+1} = u^n + dt v',
    (rho v^{n+1}, psi) = (rho v', psi) + dt/2 r(u^{n+1}),  psi in {phi_i, phi_j (U - u^n)},

r(u) the blended forces of the bonds and those of elements and loads. Each step projects the velocity onto a space that holds one increment, and what moves
at the particles' frequencies limits dt: the scheme is refused above its critical step.
"""
import numpy as np

from pdhpc.gfem.enriched_step import enriched_step
from pdhpc.gfem.galerkin import Galerkin
from pdhpc.gfem.point_state import add_at_vertices
from pdhpc.state import number

_CHECKED_EVERY = 10  # steps, after the first three: the space, and with it the critical step, changes at each


class Instant(Galerkin):
    """Scheme "instant" of a coupled step, a comparator.

    Attributes
    ----------
    critical_dt : s, of the space where it was found last. refuses : whether a larger dt is a failure.
    """

    name = "instant"
    refuses = True
    critical_dt = np.inf

    def __init__(self, *args):
        """As Galerkin. Collective."""
        super().__init__(*args)
        self._age = 0

    def follow(self, patches):
        """Take in new patches. Collective."""
        super().follow(patches)
        self._age = 0

    def entries(self):
        """Return {key: Entry} of the age of the space, so that its critical step is found when it would have been. Local."""
        return {"scheme/age": number(self, "_age", int), "scheme/critical_dt": number(self, "critical_dt")}

    def reconstruct(self):
        """Return U - u^n, (n, dim) at the points. Local."""
        self.state.read_run()
        return self.state.increment

    def solve(self, eta, time):
        """Find u^{n+1} and v^{n+1} in the space of eta. Collective. time : t_n, s."""
        solution, state, dt = self.solution, self.state, self.dt
        self._choose(eta, 0)
        self.enriched[1] = self.enriched[0]
        self._check_step()
        state.put(state.displacement, None)
        self._add_forces(time, 0.5 * dt)
        self._add_momentum()
        solution.gather_right()
        half = self._project(1.0)
        solution.change *= dt
        self._move(dt * half.field, time)
        self._add_forces(time + dt, 1.0)
        solution.gather_right()
        self._account_motions()
        end = self._project(0.0)
        solution.change[...] = half.nodes + 0.5 * dt * end.nodes
        self._accept(half.field + 0.5 * dt * end.field, time + dt)
        state.remember()

    def _account_motions(self):
        """Account for what holds prescribed components, with the force at the end of the step for its mean. Local."""
        right = self.solution.right
        right *= self.dt
        self.solution.account_motions(self.dt)
        right /= self.dt

    def _add_momentum(self):
        """Add rho v^n of the points to this rank's part of the right sides. Local."""
        state, points = self.state, self.local.points
        carried = points.mass[:, None] * state.velocity
        state.momentum += carried
        add_at_vertices(self.solution.mesh.cells, points.cell, points.start, points.shape, carried, self.solution.right)

    def _add_forces(self, time, factor):
        """Store factor times the forces r(u) of the present state: this rank's part in `right`, of the points in their momentum. Collective over neighbours.

        time : s, or None for bonds and elements alone, as of LocalParticles.evaluate.
        """
        solution, nothing = self.solution, np.zeros_like(self.solution.displacement)
        solution.evaluate_elements() if time is None else solution.evaluate(time)
        self.local.put_collar(solution.displacement)
        self.local.hold_collar(nothing, nothing)
        self.local.evaluate(time)
        solution.right[...] = solution.force
        self.state.gather_forces(solution.mesh.cells, solution.right)
        solution.right *= factor
        self.state.momentum *= factor

    def _check_step(self):
        """Find the critical step of a new space, and of others now and then. Collective."""
        if self._age < 3 or self._age % _CHECKED_EVERY == 0:
            self.critical_dt = self._critical_step()
            if self.refuses and self.dt > self.critical_dt and self.mass.failure is None:
                self.mass.failure = (f'the scheme "{self.name}" is unstable in the enriched space at hand: its critical step is {self.critical_dt:.6g} s,'
                                     f' time.dt {self.dt:.6g} s; take a smaller one, or the scheme "pinned"')
        self._age += 1

    def _critical_step(self):
        """Return the critical step in the present space, s. Collective."""
        solution, mesh, points = self.solution, self.solution.mesh, self.local.points
        kept, masses = solution.displacement.copy(), self._masses()
        number = np.arange(len(points.mass)) - np.repeat(points.start[:-1] - 1000 * mesh.cell_id[points.cell], np.diff(points.start))
        start = self.mass.solve(_noise(mesh.vertex_id, mesh.dim) * masses[0], _noise(number, mesh.dim) * masses[1])
        step = enriched_step(mesh.comm, self._trial(start), self._respond, masses)
        solution.displacement[...] = kept
        return step

    def _masses(self):
        """Return [masses of owned vertices, of points], (n, 1) each, kg. Local."""
        mesh, n = self.solution.mesh, self.solution.mesh.n_owned
        masses = np.zeros((len(mesh.points), 1))
        masses[:n, 0] = self.solution.outside_mass[:n]
        return [masses, self.local.points.mass[:, None]]

    def _trial(self, found):
        """Return what of a Solution makes its forces. Local."""
        return [found.nodes, found.field]

    def _respond(self, u):
        """Return M^-1 K u of a displacement u = [at vertices, at points]. Collective."""
        self.solution.displacement[...] = u[0]
        self.state.put(u[1], None)
        self._add_forces(None, -1.0)
        self.solution.gather_right()
        return self._trial(self.mass.solve(self.solution.right, self.state.momentum))


def _noise(numbers, dim):
    """Return (n, dim) in [-1/2, 1/2), of no structure, the same for a number on any rank."""
    return np.modf(numbers[:, None] * np.array([0.7548776662, 0.5698402910, 0.8191725134])[:dim])[0] - 0.5
