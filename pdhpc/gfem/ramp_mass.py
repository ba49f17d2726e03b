"""The mass of standard functions that fade out where particles take over: rho (1 - alpha) on the ramp, that of elements outside, lumped by row sums."""
import numpy as np

from pdhpc.jit import kernel


class RampMass:
    """D_i = sum_p rho_p V_p (1 - alpha_p) N_i(x_p) over the ramp + the lumped mass of cells that are not enriched. Nothing is solved.

    A cell of the ramp costs corners^2 + ratio^dim numbers.

    Attributes
    ----------
    lumped : (n_vertices,), kg, ghosts fresh; 0 at vertices that particles have to themselves. acting : (n_vertices,) bool, the others.
    iterations, failure : 0 and None, as there is no solver.
    """

    iterations, failure = 0, None

    def __init__(self, mesh):
        """Local."""
        self.mesh = mesh

    def follow(self, local, outside_mass):
        """Find the ramp and its mass. Collective over neighbours. local : LocalParticles. outside_mass : (n_vertices,), kg, of cells that are not enriched."""
        mesh = self.mesh
        faded = np.maximum(0.0, 1.0 - local.alpha[local.cell_slots])
        chosen = np.flatnonzero(faded.any(axis=1))
        self.cells, self.slots, self.faded = local.cells[chosen], local.cell_slots[chosen], faded[chosen]
        density = local.density[local.subdomain.particles.block[self.slots]]
        self._shape, self._along = local.lattice.shape, local.lattice.ratio
        products = (self._shape[:, :, None] * self._shape[:, None, :]).reshape(len(self._shape), -1)
        self._mass = (local.volume * density * self.faded @ products).reshape(-1, *2 * [self._shape.shape[1]])
        lumped = np.zeros((len(mesh.points), 1))
        add_rows(mesh.cells, self.cells, self._mass, 1.0, np.ones_like(lumped), lumped)
        shared = mesh.exchange.bind(lumped)
        shared.accumulate()
        shared.refresh()
        shared.free()
        self.lumped = lumped[:, 0] + outside_mass
        self.acting = self.lumped > 0.0

    def condition(self):
        """Return the condition number of the scaled matrix, which is diagonal."""
        return 1.0

    def take_out(self, factor, velocity, right):
        """right -= factor M v of the ramp, consistent; velocity, right (n_vertices, dim). Local: this rank's part, to be accumulated."""
        add_rows(self.mesh.cells, self.cells, self._mass, -factor, velocity, right)

    def divide(self, factor, velocity, right, change):
        """change = factor v + right / D at owned vertices, 0 where only particles act; right has its part of all ranks. Local."""
        divide(self.lumped[: self.mesh.n_owned], factor, velocity, right, change)

    def add_to_points(self, nodal, field):
        """field += (1 - alpha) sum_i phi_i nodal[i] at the particles of the ramp; nodal (n_vertices, dim), fresh ghosts. Local."""
        add_faded(self.slots, self.cells, self.faded, self._shape, self._along, self.mesh.cells, nodal, field)


@kernel
def add_rows(cells, chosen, matrix, factor, nodal, result):
    """result += factor matrix[n] nodal at the corners of cells chosen (n,); matrix (n, corners, corners), nodal, result (n_vertices, dim)."""
    for n in range(len(chosen)):
        corner = cells[chosen[n]]
        for a in range(len(corner)):
            for d in range(nodal.shape[1]):
                total = 0.0
                for b in range(len(corner)):
                    total += matrix[n, a, b] * nodal[corner[b], d]
                result[corner[a], d] += factor * total


@kernel
def divide(lumped, factor, velocity, right, change):
    """change = factor v + right / D where D, lumped (n,), is positive, else 0; the others (n_vertices, dim)."""
    for n in range(len(lumped)):
        for d in range(right.shape[1]):
            change[n, d] = factor * velocity[n, d] + right[n, d] / lumped[n] if lumped[n] > 0.0 else 0.0


@kernel
def add_faded(slots, chosen, faded, shape, along, cells, nodal, field):
    """field[slots] += faded sum_i N_i nodal[i] at the particles of cells chosen (n,); slots, faded (n, n_points), shape (n_points, corners).

    `along` particles at a time lie in slots that follow each other, on a line along which the sum is linear.
    """
    corners, dim = shape.shape[1], nodal.shape[1]
    for c in range(len(chosen)):
        corner = cells[chosen[c]]
        for d in range(dim):
            for p in range(0, slots.shape[1], along):
                first, last = 0.0, 0.0
                for a in range(corners):
                    first += shape[p, a] * nodal[corner[a], d]
                    last += shape[p + along - 1, a] * nodal[corner[a], d]
                slope, slot = (last - first) / (along - 1), slots[c, p]
                for i in range(along):
                    field[slot + i, d] += faded[c, p + i] * (first + slope * i)
