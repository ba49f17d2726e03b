"""What a coupled body looks like to those who watch a run: every particle of the lattice, whether it moves by itself or as the mesh says."""
import numpy as np

from pdhpc.gfem.points import interpolate
from pdhpc.peridynamics.view import View

_PIECE = 1 << 14  # cells interpolated together: bounds the temporary memory


class CoupledView(View):
    """The particles of a lattice, in ascending id; outside the patches they are where the elements have them.

    Looking costs time and memory per particle; steps in between do not.
    """

    def __init__(self, local, solution):
        """local : LocalParticles. solution : MeshSolution."""
        super().__init__(local.subdomain, local.law)
        self._local, self._solution = local, solution

    def prepare(self):
        """Put the particles outside the patches, ghosts too, where the elements have them. Local."""
        self._fill(self._solution.displacement, self._local.subdomain.particles.position)

    def _fill(self, nodal, field):
        """Store the interpolation of nodal (n_vertices, dim) in field (n_slots, dim) outside the patches."""
        local, mesh = self._local, self._solution.mesh
        cells = np.flatnonzero(~local.enriched)
        for first in range(0, len(cells), _PIECE):
            slots, cell, number = local.slots_of(cells[first : first + _PIECE])
            values = np.empty((len(slots), mesh.dim))
            interpolate(mesh.cells, cell, local.lattice.shape[number], nodal, values)
            field[slots] = values

    def field(self, name):
        """Return the field `name` (peridynamics/fields.py, and "active": 1 where particles move by themselves) of all particles. Local; after `prepare`."""
        particles = self._local.subdomain.particles
        if name == "displacement":
            return particles.owned(particles.position)
        if name == "velocity":
            whole = particles.velocity.copy()
            self._fill(self._solution.velocity, whole)
            return particles.owned(whole)
        if name == "force_density":
            return self._force_densities()
        return super().field(name)

    def _force_densities(self):
        """Return (n, dim), N/m^3: those of bonds and loads where particles move, the share of each particle in the forces of its element elsewhere."""
        raise NotImplementedError

    def foremost(self, members, ahead, threshold):
        """As View.foremost; only particles of enriched cells can have lost bonds."""
        mine = np.flatnonzero(self._local.inside[self._subdomain.particles.slots[members]])
        found = super().foremost(members[mine], ahead[mine], threshold)
        return int(mine[found]) if found >= 0 else -1
