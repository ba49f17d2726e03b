"""What the multi-time-step method is compared with: velocity continuity at every sub-step, and sub-cycling without multipliers."""
import numpy as np

from pdhpc.mts.two_regions import TwoRegions
from pdhpc.mts.view import first_of
from pdhpc.peridynamics.view import View
from pdhpc.state import Entry


class MicroContinuity(TwoRegions):
    """One velocity of both copies at every step of the fine region (Gravouil & Combescure 2001), explicit in both: stable, and dissipative.

    The coarse region steps freely first; at sub-step j, th = j/m, with v_A interpolated between its free velocities at the macro times,

        (dT/2 M_A^-1 + dt/2 M_B^-1) L_j = (1 - th) v_A,n + th v_A,n+1 - v_B,   v_B += dt/2 M_B^-1 L_j, a_B += M_B^-1 L_j,

    and the last L_j acts on the coarse region: v_A -= dT/2 M_A^-1 L_m, a_A -= M_A^-1 L_m.
    """

    def __init__(self, coarse, fine, m, interface, common_bonds):
        """interface : Interface; common_bonds : CommonBonds or None. Collective."""
        super().__init__(coarse, fine, m)
        self.interface, self.common_bonds = interface, common_bonds
        total = 0.5 * coarse.dt * interface.coarse_mobility + 0.5 * fine.dt * interface.fine.mobility
        self._diagonal = np.where(total > 0.0, total, 1.0)
        self._free_velocity = self._coarse_velocity()

    def _coarse_velocity(self):
        fine = self.interface.fine
        return self.interface.velocity_gap() + fine.subdomain.particles.velocity[fine.slots]

    def advance(self):
        """Do one macro step. Collective over the owners of neighbours and of copies."""
        self.coarse.advance()
        before, self._free_velocity = self._free_velocity, self._coarse_velocity()
        copies = self.interface.fine
        particles, slots, over_share = copies.subdomain.particles, copies.slots, 1.0 / copies.share[:, None]
        for j in range(1, self.m + 1):
            self.fine.advance()
            th = j / self.m
            x = ((1.0 - th) * before + th * self._free_velocity - particles.velocity[slots]) / self._diagonal
            particles.velocity[slots] += 0.5 * self.fine.dt * copies.mobility * x
            particles.force_density[slots] += over_share * x
        copies, x = self.interface.coarse, self.interface.to_coarse(x)
        copies.subdomain.particles.velocity[copies.slots] -= 0.5 * self.dt * copies.mobility * x
        copies.subdomain.particles.force_density[copies.slots] -= x / copies.share[:, None]
        if self.common_bonds is not None:
            self.common_bonds.unify()
        self.step += 1

    def state(self):
        """Return {key: Entry} of everything a continued run needs."""
        ids = self.interface.fine.ids
        return {**super().state(), "free_velocity": Entry(lambda: self._free_velocity, lambda value: setattr(self, "_free_velocity", np.array(value)), ids)}


class Subcycling(TwoRegions):
    """Regions that meet without overlap; each sees the other's particles near the border as given: no multipliers, no guarantee of stability or energy.

    The coarse region drifts first; the fine one's m steps see its particles on the straight line between their old and new displacements; then the coarse
    forces are evaluated with the fine particles where they arrived. A bond across the border breaks for each side when that side finds it beyond its limit.
    """

    def __init__(self, coarse, fine, m, collars):
        """collars : [Collar of coarse particles in the fine region, Collar of fine particles in the coarse region]."""
        super().__init__(coarse, fine, m)
        self._to_fine, self._to_coarse = collars

    def advance(self):
        """Do one macro step. Collective over the owners of neighbours and of copies."""
        self._to_fine.remember()
        self.coarse.begin()
        self._to_fine.send()
        for j in range(1, self.m + 1):
            self.fine.begin()
            self._to_fine.place(j / self.m)
            self.fine.internal.evaluate()
            self.fine.finish()
        self._to_coarse.send()
        self._to_coarse.place(1.0)
        self.coarse.internal.evaluate()
        self.coarse.finish()
        self.step += 1


class Collar:
    """Copies of one region's particles, near the border, in the other region, which move as they are told."""

    def __init__(self, exchange, source, slots, subdomain):
        """exchange : GhostExchange whose owned rows are `source`'s owned particles and whose ghosts are the copies. slots (n,) of the copies in `subdomain`."""
        self._source, self._slots, self._particles = source, slots, subdomain.particles
        n, dim = source.particles.n_owned, subdomain.particles.dim
        self._field = np.zeros((n + len(slots), dim))
        self._n, self._bound = n, exchange.bind(self._field)
        self._reference = subdomain.places_at(slots) if len(slots) and not subdomain.particles.linear else np.zeros((len(slots), dim))
        self._old = np.zeros((len(slots), dim))

    def remember(self):
        """Take the copies' displacements as those that the next interpolation starts from. Local."""
        self._old[...] = self._particles.displacement[self._slots]

    def send(self):
        """Tell the copies where their originals are now. Collective over the owners of copies."""
        self._field[: self._n] = self._source.particles.owned(self._source.particles.displacement)
        self._bound.refresh()

    def place(self, th):
        """Put the copies at the fraction `th` of the way to where they were told. Local."""
        displacement = (1.0 - th) * self._old + th * self._field[self._n :]
        self._particles.displacement[self._slots] = displacement
        self._particles.position[self._slots, : displacement.shape[1]] = self._reference + displacement
        self._particles.velocity[self._slots] = 0.0


class BorderView:
    """The particles of two regions that meet: each region's own. As peridynamics.view.View."""

    carrier, cells = "particle", None

    def __init__(self, stepper, own):
        """own : of both regions, (n_owned,) bool, the particles that are not copies."""
        self._steppers = stepper.coarse, stepper.fine
        self._parts = [View(each.subdomain, each.law) for each in self._steppers]
        self._own = [np.flatnonzero(mask) for mask in own]
        self.dim = self._parts[0].dim
        self.ids = self._join("ids")
        self.n = len(self.ids)

    def first_not_finite(self):
        """Return (id, place) of the first particle whose displacement is NaN or infinite, None without any. Local."""
        return first_of(self._parts)

    def _join(self, name):
        return np.concatenate([getattr(part, name)[own] for part, own in zip(self._parts, self._own)])

    @property
    def volume(self):
        """(n,), m^3."""
        return self._join("volume")

    @property
    def block(self):
        """(n,) uint8."""
        return self._join("block")

    def places(self, members=slice(None)):
        """Return (n, dim) reference positions, m, of all particles or of `members`. Local."""
        return np.concatenate([part.places(own) for part, own in zip(self._parts, self._own)])[members]

    def prepare(self):
        """Bring what `field` reads up to date: nothing to do, ghosts are fresh after a step."""

    def field(self, name):
        """Return the field `name` (peridynamics/fields.py) of all particles. Local."""
        return np.concatenate([part.field(name)[own] for part, own in zip(self._parts, self._own)])

    def foremost(self, members, ahead, threshold):
        """Return the m whose members[m] has a grown damage above `threshold` with the largest ahead[m]; -1 if none. Local."""
        damaged = np.flatnonzero(self.field("damage")[members] > threshold)
        return int(damaged[np.argmax(ahead[damaged])]) if len(damaged) else -1

    def directed_bonds(self):
        """Return the number of directed bonds of this rank's particles. Local."""
        return int(sum(each.subdomain.bonds.family_size[own].sum(dtype=np.int64) for each, own in zip(self._steppers, self._own)))

    def broken(self):
        """Return the number of directed bonds that broke since the start. Local."""
        bonds = [each.subdomain.bonds for each in self._steppers]
        return int(sum((each.initial_size - each.alive())[own].sum(dtype=np.int64) for each, own in zip(bonds, self._own)))
