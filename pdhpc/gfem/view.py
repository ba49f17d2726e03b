"""What a coupled body looks like to those who watch a run: every particle of the lattice, whether it moves by itself or as the mesh says."""
import numpy as np

from pdhpc.gfem.points import interpolate
from pdhpc.kernels import sweeps
from pdhpc.kernels.motion import first_not_finite
from pdhpc.peridynamics.view import View

_PIECE = 1 << 14  # cells interpolated together: bounds the temporary memory


class CoupledView(View):
    """The particles of a lattice, in ascending id; outside the patches they are where the elements have them.

    Looking costs time and memory per particle; steps in between do not.
    """

    def __init__(self, stepper):
        """stepper : CoupledStep."""
        self._stepper, self._local, self._solution = stepper, stepper.local, stepper.solution
        super().__init__(self._local.subdomain, self._local.law)
        self._kept = {}  # by members of a tip: which of them lie in enriched cells

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
            interpolate(mesh.cells, cell, number, local.lattice.shape, nodal, values)
            field[slots] = values

    def field(self, name):
        """Return the field `name` (peridynamics/fields.py) of all particles; active : 1 where they move by themselves. Local; after `prepare`."""
        particles = self._local.subdomain.particles
        if name == "displacement":
            return particles.owned(particles.position)
        if name == "velocity":
            whole = particles.velocity.copy()
            self._fill(self._solution.velocity, whole)
            return particles.owned(whole)
        if name == "force_density":
            return self._force_densities()
        if name == "active":
            return particles.owned(self._local.inside).astype(float)
        return super().field(name)

    def _force_densities(self):
        """Return (n, dim), N/m^3: of the bonds of all particles, and of loads. Local."""
        domain, particles = self._subdomain, self._subdomain.particles
        unbreakable = self._law._replace(break_at=np.full_like(self._law.break_at, np.inf))
        bonds = domain.bonds.arrays._replace(trigger=np.full_like(domain.bonds.arrays.trigger, np.inf))
        total = np.zeros(particles.force_density.shape[::-1]).T
        sweeps.bond_forces(bonds, domain.points, unbreakable, None, True, particles.third, np.concatenate(domain.rows), total, particles.dissipated)
        for load in self._local.loads:
            load.whole().add_to(total, self._stepper.time)
        return particles.owned(total)

    def support_forces(self, vertices):
        """Return (n, dim), N: what holds `vertices` (n,), owned ones of prescribed motion, against elements and loads, without their inertia.

        Collective over neighbours.
        """
        solution = self._solution
        solution.right[:] = solution.force
        solution.gather_right()
        return -solution.right[vertices]

    def first_not_finite(self):
        """Return (id, place) of a particle that moves by itself, or (id, place) of a vertex, whose displacement is NaN or infinite, None without any. Local."""
        local, solution, particles = self._local, self._solution, self._local.subdomain.particles
        slots = local.cell_slots.ravel()
        row = int(first_not_finite(particles.position, slots))
        if row >= 0:
            return int(particles.id[np.flatnonzero(particles.slots == slots[row])[0]]), tuple(float(x) for x in local.subdomain.places_at(slots[row])[0])
        mesh = solution.mesh
        bad = np.flatnonzero(~np.isfinite(solution.displacement[: mesh.n_owned]).all(axis=1))
        return (int(mesh.vertex_id[bad[0]]), tuple(float(x) for x in mesh.points[bad[0]])) if len(bad) else None

    def foremost(self, members, ahead, threshold):
        """As View.foremost; only particles of enriched cells can have lost bonds."""
        key = id(members), len(members), self._local.n_active
        if self._kept.get(id(members), (None,))[0] != key:
            self._kept[id(members)] = key, np.flatnonzero(self._local.inside[self._subdomain.particles.slots[members]])
        mine = self._kept[id(members)][1]
        found = super().foremost(members[mine], ahead[mine], threshold)
        return int(mine[found]) if found >= 0 else -1
