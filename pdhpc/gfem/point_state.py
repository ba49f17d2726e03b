"""The global solution at the points of enriched cells, and the sums of momentum between it and the functions of the mesh."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.simd import LANES


class PointState:
    """u^n and v^n at the points of this rank's enriched cells while the local run moves the particles on, and which momentum the points get from it.

    With k sub-steps of tau, dt = k tau, b the load and I1, I2 the impulse of the blended forces F^alpha and its moment:

        q_u = dt rho v^n + I2 + dt^2/2 b,   q_v = rho v^n + I1 + dt b,

    which where alpha is 1 within the reach of bonds are rho (U - u^n) and rho V by the local run's own identities.

    Attributes
    ----------
    displacement, velocity (n, dim) : u^n, v^n. increment (n, dim) : U - u^n. end_velocity (n, dim) : V. momentum (n, dim) : V_p q_u, then V_p q_v.
    """

    def __init__(self, local):
        """local : LocalParticles. Local."""
        self._local = local
        self.follow()

    def follow(self):
        """Take in the points of new patches, with the state that their particles have. Local."""
        local, points = self._local, self._local.points
        dim = local.subdomain.particles.dim
        self.displacement, self.velocity, self.increment, self.end_velocity, self.momentum = (np.zeros((len(points.slots), dim)) for _ in range(5))
        blended = local.blended
        lane = np.flatnonzero(blended.inside)
        slots = blended.rows[lane // LANES] + lane % LANES
        order = np.argsort(points.slots)
        self._lane, self._point = lane, order[np.searchsorted(points.slots[order], slots)]
        self.remember()

    def remember(self):
        """Keep the state of the particles as u^n and v^n. Local."""
        particles, slots = self._local.subdomain.particles, self._local.points.slots
        take_points(slots, particles.position, self.displacement)
        take_points(slots, particles.velocity, self.velocity)

    def read_run(self):
        """Take what the local run did: increment and end_velocity. Local."""
        particles, slots = self._local.subdomain.particles, self._local.points.slots
        take_points(slots, particles.position, self.increment)
        self.increment -= self.displacement
        take_points(slots, particles.velocity, self.end_velocity)

    def gather_displacement_momentum(self, dt, cells, right):
        """Set momentum to V_p q_u, kg m, and add what all particles have of it to right (n_vertices, dim). Local."""
        blended = self._local.blended
        self._gather(self.increment, dt, blended.moment, cells, right)

    def gather_velocity_momentum(self, cells, right):
        """Set momentum to V_p q_v, kg m/s, and add what all particles have of it to right (n_vertices, dim). Local."""
        self._gather(self.end_velocity, 1.0, self._local.blended.impulse, cells, right)

    def _gather(self, field, factor, sums, cells, right):
        local, blended, points = self._local, self._local.blended, self._local.points
        np.multiply(points.mass[:, None], field, out=self.momentum)
        put_blended(self._lane, self._point, self.velocity, blended.density, sums, factor, local.volume, self.momentum)
        add_at_vertices(cells, points.cell, points.start, points.shape, self.momentum, right)
        add_outside(blended.cell, blended.inside, blended.shape, sums, local.volume, cells, right)

    def gather_forces(self, cells, right):
        """Set momentum to V_p F_p, N, of the forces that LocalParticles.evaluate left; add all particles' to right (n_vertices, dim). Local."""
        local, blended, points = self._local, self._local.blended, self._local.points
        take_points(points.slots, local.subdomain.particles.force_density, self.momentum)
        self.momentum *= local.volume
        put_blended(self._lane, self._point, self.velocity, blended.density, blended.impulse, 0.0, local.volume, self.momentum)
        add_at_vertices(cells, points.cell, points.start, points.shape, self.momentum, right)
        add_outside(blended.cell, blended.inside, blended.shape, blended.impulse, local.volume, cells, right)

    def put(self, displacement, velocity):
        """Give the particles this state, (n, dim) each, None for what stays. Local."""
        particles, slots = self._local.subdomain.particles, self._local.points.slots
        for target, values in ((particles.position, displacement), (particles.velocity, velocity)):
            if values is not None:
                put_points(slots, values, target)


@kernel
def take_points(slots, field, result):
    """result[n] = field[slots[n]]; result (n, dim)."""
    for d in range(result.shape[1]):
        for n in range(len(slots)):
            result[n, d] = field[slots[n], d]


@kernel
def put_points(slots, values, field):
    """field[slots[n]] = values[n]; values (n, dim)."""
    for d in range(values.shape[1]):
        for n in range(len(slots)):
            field[slots[n], d] = values[n, d]


@kernel
def put_blended(lane, point, velocity, density, sums, factor, volume, momentum):
    """momentum[point] = V (factor rho v^n + sum of the lane); lane, point (m,), velocity, momentum (n, dim), density (8 n_rows,), sums (n_rows, dim, 8)."""
    for k in range(len(lane)):
        t, at, n = lane[k] // LANES, lane[k] % LANES, point[k]
        for d in range(momentum.shape[1]):
            momentum[n, d] = volume * (factor * density[lane[k]] * velocity[n, d] + sums[t, d, at])


@kernel
def add_at_vertices(cells, cell, start, shape, momentum, right):
    """right (n_vertices, dim) += sum_p N_i momentum_p over the points (gfem.points.Points) of enriched cells."""
    for c in range(len(cell)):
        corner = cells[cell[c]]
        for p in range(start[c], start[c + 1]):
            for a in range(len(corner)):
                for d in range(momentum.shape[1]):
                    right[corner[a], d] += shape[p, a] * momentum[p, d]


@kernel
def add_outside(lane_cell, inside, shape, sums, volume, cells, right):
    """right (n_vertices, dim) += V N_i times the sum of each lane that is not inside an enriched cell; as in Blended."""
    for n in range(len(lane_cell)):
        if lane_cell[n] >= 0 and not inside[n]:
            corner = cells[lane_cell[n]]
            for d in range(right.shape[1]):
                value = volume * sums[n // LANES, d, n % LANES]
                for a in range(len(corner)):
                    right[corner[a], d] += shape[n, a] * value
