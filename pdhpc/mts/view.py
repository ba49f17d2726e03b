"""What a body in two regions looks like to those who watch: each particle once, what both copies have a part of added up."""
import numpy as np

from pdhpc.peridynamics import fields
from pdhpc.peridynamics.view import View


def first_of(views):
    """Return the finding of `first_not_finite` with the smallest id among some views, None without any. Local."""
    return min((found for found in (view.first_not_finite() for view in views) if found is not None), default=None)


class JoinedView:
    """The particles of a coarse and a fine region: the coarse ones outside the overlap, then all fine ones. As peridynamics.view.View.

    `field`, `foremost` and `broken` are Collective over the owners of copies.
    """

    carrier, cells = "particle", None

    def __init__(self, coarse, fine, interface, common_bonds, operator=None):
        """coarse, fine : VelocityVerlet. interface : Interface. common_bonds : CommonBonds. operator : of interface_operator.py, or None."""
        self._steppers, self._interface, self._common, self._operator = (coarse, fine), interface, common_bonds, operator
        self._parts = [View(each.subdomain, each.law) for each in (coarse, fine)]
        self._copies = [_indices(copies.subdomain.particles, copies.slots) for copies in (interface.coarse, interface.fine)]
        self._only = np.setdiff1d(np.arange(self._parts[0].n), self._copies[0])
        self.dim = self._parts[0].dim
        self.ids = self._join(self._parts[0].ids, self._parts[1].ids)
        self.n = len(self.ids)
        self._initial = self._added(*(each.subdomain.bonds.initial_size for each in self._steppers), self._common.initial_counts())
        self._families = self._added(*(each.subdomain.bonds.family_size for each in self._steppers), self._common.possible_counts())

    @property
    def volume(self):
        """(n,), m^3."""
        return self._join(self._parts[0].volume, self._parts[1].volume)

    @property
    def block(self):
        """(n,) uint8."""
        return self._join(self._parts[0].block, self._parts[1].block)

    def places(self, members=slice(None)):
        """Return (n, dim) reference positions, m, of all particles or of `members`. Local."""
        return self._join(self._parts[0].places(), self._parts[1].places())[members]

    def prepare(self):
        """Bring positions and ghosts up to date with the displacements that the link pass changed. Collective over neighbours."""
        for each in self._steppers:
            each.subdomain.particles.place()
            each.internal.refresh()

    def field(self, name):
        """Return the field `name` (peridynamics/fields.py) of all particles."""
        subdomain = self._steppers[1].subdomain
        if name in ("displacement", "active"):
            return self._join(*(part.field(name) for part in self._parts))
        if name == "velocity":
            coarse, fine = (part.field(name) for part in self._parts)
            fine = fine.copy()
            if self._operator is not None:
                fine[self._copies[1]] += self._operator.velocity_offset()
            return self._join(coarse, fine)
        if name in ("damage", "precrack"):
            counts = self._alive() if name == "damage" else self._initial
            before = self._initial if name == "damage" else self._families
            return 1.0 - counts / np.maximum(before, 1) - (before == 0)
        if name == "force_density":
            coarse, fine = (part.field(name).copy() for part in self._parts)
            for values, index, copies in zip((coarse, fine), self._copies, (self._interface.coarse, self._interface.fine)):
                values[index] *= copies.share[:, None]
            return self._added(coarse, fine)
        if name == "strain":
            pairs = zip(*(fields.deformation_moments(each.subdomain, each.law) for each in self._steppers))
            return fields.strain_of(subdomain, *(self._added(*pair) for pair in pairs))
        return self._added(*(part.field(name) for part in self._parts))

    def first_not_finite(self):
        """Return (id, place) of the first particle whose displacement is NaN or infinite, None without any. Local."""
        return first_of(self._parts)

    def foremost(self, members, ahead, threshold):
        """Return the m whose members[m] has a grown damage above `threshold` with the largest ahead[m]; -1 if none."""
        damaged = np.flatnonzero(self.field("damage")[members] > threshold)
        return int(damaged[np.argmax(ahead[damaged])]) if len(damaged) else -1

    def broken(self):
        """Return the number of directed bonds that broke since the start, each bond of both regions counted once."""
        return int((self._initial - self._alive()).sum())

    def directed_bonds(self):
        """Return the number of directed bonds of this rank's particles, each of both regions counted once. Local."""
        return int(self._families.sum())

    def _alive(self):
        """Return (n,) intact bonds of each particle."""
        return self._added(*(each.subdomain.bonds.alive() for each in self._steppers), self._common.intact_counts())

    def _join(self, coarse, fine):
        return np.concatenate([coarse[self._only], fine])

    def _added(self, coarse, fine, twice=None):
        """Return (n, ...) with the coarse copies' values added to the fine ones', less what both count (`twice`, of the coarse copies)."""
        part = coarse[self._copies[0]].astype(float)
        if twice is not None:
            part -= twice
        fine = fine.astype(float)
        shape = (len(part), -1) if len(part) else (0, int(np.prod(coarse.shape[1:], dtype=int)))
        fine[self._copies[1]] += self._interface.columns_to_fine(part.reshape(shape)).reshape((-1,) + coarse.shape[1:])
        return self._join(coarse, fine)


def _indices(particles, slots):
    """Return the owned indices of some slots."""
    order = np.argsort(particles.slots)
    return order[np.searchsorted(particles.slots, slots, sorter=order)]
