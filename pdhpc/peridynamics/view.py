"""What the body of this rank looks like to those who watch a run: each particle once, whatever holds it."""
import numpy as np

from pdhpc.kernels.bond_states import foremost_damaged
from pdhpc.kernels.motion import first_not_finite
from pdhpc.peridynamics.fields import field


class View:
    """The owned particles of one subdomain, in ascending id.

    Attributes
    ----------
    ids : (n,) int64. n, dim : int. volume : (n,), m^3. block : (n,) uint8. carrier : what a point is called. cells : of a mesh; particles have none.
    """

    carrier, cells = "particle", None

    def __init__(self, subdomain, law):
        self._subdomain, self._law = subdomain, law
        particles = subdomain.particles
        self.n, self.dim = particles.n_owned, particles.dim
        self.ids = particles.id[: self.n]

    @property
    def volume(self):
        """(n,), m^3."""
        return self._subdomain.particles.owned(self._subdomain.particles.volume)

    @property
    def block(self):
        """(n,) uint8."""
        return self._subdomain.particles.owned(self._subdomain.particles.block)

    def places(self, members=slice(None)):
        """Return (n, dim) reference positions, m, of all particles or of `members`. Local."""
        return self._subdomain.places(members)

    def prepare(self):
        """Bring what `field` reads up to date. Nothing to do here: ghosts are fresh after a step."""

    def field(self, name):
        """Return the field `name` (peridynamics/fields.py) of all particles. Local."""
        return field(name, self._subdomain, self._law)

    def first_not_finite(self):
        """Return (id, place) of the first particle whose displacement is NaN or infinite, None without any. Local."""
        particles = self._subdomain.particles
        row = int(first_not_finite(particles.displacement, particles.slots))
        return None if row < 0 else (int(particles.id[row]), tuple(float(x) for x in self.places(row)[0]))

    def foremost(self, members, ahead, threshold):
        """Return the m whose members[m] has a grown damage above `threshold` with the largest ahead[m]; -1 if none. Local."""
        bonds = self._subdomain.bonds
        return int(foremost_damaged(bonds.arrays, bonds.slots, bonds.initial_size, threshold, members, ahead))

    def directed_bonds(self):
        """Return the number of directed bonds of this rank's particles. Local."""
        return self._subdomain.bonds.n_directed

    def broken(self):
        """Return the number of directed bonds that broke since the start. Local."""
        return int((self._subdomain.bonds.initial_size - self._subdomain.bonds.alive()).sum(dtype=np.int64))
