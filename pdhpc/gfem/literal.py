"""What the coupled step is compared with: the five stages taken at their word.

    (rho u^{n+1}, psi) = (rho (2 u^n - u^{n-1}), psi) + dt^2 ((b, psi) - (sigma(grad u^n), grad psi)),   psi in {phi_i, phi_j eta},   eta = u_PD,

u_PD the displacement of the particles, with its gradient rebuilt by moving least squares that are cut off at broken bonds. Broken gradients make the stress too
stiff, and the projections of u^n and u^{n-1} lose what the new space cannot say: it is refused above the critical step of its space, and far off below it.
"""
import numpy as np

from pdhpc.gfem.instant import Instant
from pdhpc.gfem.point_state import add_at_vertices, take_points
from pdhpc.gfem.point_stress import add_stress_forces, gradient_at_points, stress_2d
from pdhpc.mls.basis import Basis
from pdhpc.mls.reconstruct import MovingLeastSquares
from pdhpc.state import Entry


class Literal(Instant):
    """Scheme "literal" of a coupled step, a comparator in two dimensions."""

    name = "literal"

    def __init__(self, *args):
        """As Galerkin. Collective."""
        super().__init__(*args)
        subdomain, lattice = self.local.subdomain, self.local.lattice
        reach = float(np.linalg.norm(subdomain.bonds.arrays.vector, axis=1).max())
        self._fit = MovingLeastSquares(subdomain, lattice.spacing, reach, Basis(lattice.mesh.dim))
        self._nodes_before = self.solution.displacement - self.dt * self.solution.velocity
        self._tested = np.zeros_like(self._nodes_before)
        self._eta = None
        self._known = np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 2, 2))  # slots; u^{n-1} and grad u^n there

    def follow(self, patches):
        """Take in new patches: elements act everywhere outside enriched cells, stress at the points in them. Collective."""
        solution, local, mesh = self.solution, self.local, self.solution.mesh
        solution.follow(patches, np.zeros(len(mesh.points)), patches.enriched[: mesh.n_owned_cells])
        super().follow(patches)
        before = mesh.exchange.bind(self._nodes_before)
        before.refresh()
        before.free()
        points = local.points
        held = local.lattice.slots_of(points.cell) >= 0
        number = np.broadcast_to(np.arange(held.shape[1]), held.shape)[held]
        cell = np.repeat(points.cell, np.diff(points.start))
        self._shape_gradient = local.lattice.gradient[number]
        self._moduli = solution.material.moduli[solution.material.kind[cell], number]
        self._places = mesh.points[mesh.cells[cell, 0]] + (local.lattice.template[number] + 0.5) * local.lattice.spacing
        self._before = np.einsum("pa,pad->pd", points.shape, self._nodes_before[mesh.cells[cell]])
        self._gradient = np.einsum("paj,pad->pdj", self._shape_gradient, solution.displacement[mesh.cells[cell]])
        slots, before, gradient = self._known
        _, new, old = np.intersect1d(points.slots, slots, return_indices=True)
        self._before[new], self._gradient[new] = before[old], gradient[old]
        self._eta = np.zeros_like(self._before)

    def entries(self):
        """Return what Instant.entries does, u^{n-1}, and grad u^n at the points, by particle: NaN at others. Local."""
        particles, mesh = self.local.subdomain.particles, self.solution.mesh
        n, ids = mesh.n_owned, particles.id[: particles.n_owned]
        nodes = Entry(lambda: self._nodes_before[:n], lambda values: np.copyto(self._nodes_before[:n], values), mesh.vertex_id[:n])
        points = [Entry(lambda at=at: self._by_particle(at), lambda values, at=at: self._know(at, values), ids) for at in (1, 2)]
        return {**super().entries(), "scheme/nodes_before": nodes, "scheme/before": points[0], "scheme/gradient": points[1]}

    def _by_particle(self, at):
        """Return rows of owned particles of one of the fields that are known at points. Local."""
        particles, values = self.local.subdomain.particles, self._known[at]
        by_slot = np.full((len(particles.position), *values.shape[1:]), np.nan)
        by_slot[self._known[0]] = values
        return by_slot[particles.slots]

    def _know(self, at, values):
        """Take one of the fields at points from rows of owned particles. Local."""
        there = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        known = list(self._known)
        known[0], known[at] = self.local.subdomain.particles.slots[there], np.array(values[there])
        self._known = tuple(known)

    def reconstruct(self):
        """Return u_PD at the points, (n, dim); its gradient is kept. Local."""
        local, points = self.local, self.local.points
        valid = local.inside.copy()
        valid[local.collar.slots] = True
        position = local.subdomain.particles.position
        fit = self._fit.reconstruct(self._places, points.slots.astype(np.int32), position, valid)
        self._gradients = self._shape_gradient, np.ascontiguousarray(fit.gradient)
        return np.ascontiguousarray(fit.value)

    def solve(self, eta, time):
        """Find u^{n+1} in the space of eta. Collective. time : t_n, s."""
        solution, state, dt = self.solution, self.state, self.dt
        self._eta = eta
        self._choose(eta, 0)
        self.enriched[1] = self.enriched[0]
        self._check_step()
        solution.evaluate(time)
        carried = 2.0 * state.displacement - self._before
        nodes = 2.0 * solution.displacement - self._nodes_before
        found = self._step(carried, nodes, dt * dt, time)
        solution.change[...] = found.nodes - solution.displacement
        increment = found.field - state.displacement
        self._take(found, increment, time)

    def _take(self, found, increment, time):
        """Make u^{n+1} the state; velocities, of which local runs start, are (u^{n+1} - u^{n-1}) / 2 dt carried on by dt/2. Collective over neighbours."""
        solution, state, dt = self.solution, self.state, self.dt
        acceleration = (increment - (state.displacement - self._before)) / dt**2
        nodal = (solution.change - (solution.displacement - self._nodes_before)) / dt**2
        self._before, self._nodes_before = state.displacement.copy(), solution.displacement.copy()
        self._gradient = self._gradient_of(found)
        self._known = self.local.points.slots, self._before, self._gradient
        velocity = increment / dt + 0.5 * dt * acceleration
        self._move(increment, time)
        solution.change[...] = solution.change / dt + 0.5 * dt * nodal
        self._accept(velocity, time + dt)
        state.remember()

    def _step(self, carried, nodes, factor, time):
        """Return M^-1 ((rho carried, psi) + factor ((b, psi) - (sigma, grad psi))), loads at `time` unless it is None. Collective."""
        solution, state, points, cells, n = self.solution, self.state, self.local.points, self.mass.cells, self.solution.mesh.n_owned
        stress = np.empty_like(self._gradient)
        stress_2d(self._moduli, self._gradient, factor * self.local.volume, stress)
        np.multiply(solution.force, factor, out=solution.right)
        self._tested[...] = 0.0
        add_stress_forces(cells.corners, (cells.start, points.shape, self._eta), self._gradients, self.mass.mean, stress, solution.right, self._tested)
        np.multiply(points.mass[:, None], carried, out=state.momentum)
        if time is not None:
            self._add_loads(factor, time)
        add_at_vertices(solution.mesh.cells, points.cell, points.start, points.shape, state.momentum, solution.right)
        solution.gather_right()
        solution.right[:n] += solution.outside_mass[:n, None] * nodes[:n]
        return self.mass.solve(solution.right, state.momentum, self._tested)

    def _add_loads(self, factor, time):
        """Add factor times the loads on points to their momentum. Local."""
        total = np.zeros_like(self.local.subdomain.particles.force_density)
        for load in self.local.acting:
            load.add_to(total, time)
        at_points = np.empty_like(self.state.momentum)
        take_points(self.local.points.slots, total, at_points)
        self.state.momentum += factor * self.local.volume * at_points

    def _gradient_of(self, found):
        result, cells = np.empty_like(self._gradient), self.mass.cells
        at_points = cells.start, self.local.points.shape, self._eta
        gradient_at_points(cells.corners, at_points, self._gradients, self.mass.mean, found.nodes, found.amplitude, result)
        return result

    def _masses(self):
        return [*super()._masses(), np.zeros((1, 1, 1))]

    def _trial(self, found):
        return [*super()._trial(found), self._gradient_of(found)]

    def _respond(self, u):
        """Return M^-1 K u of a displacement u = [at vertices, at points, its gradient at points]. Collective."""
        kept, self._gradient = self._gradient, u[2]
        self.solution.displacement[...] = u[0]
        self.solution.evaluate_elements()
        found = self._step(np.zeros_like(u[1]), np.zeros_like(u[0]), -1.0, None)
        self._gradient = kept
        return self._trial(found)
