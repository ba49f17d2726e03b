"""The interface: the particles that both regions hold, what acts between their two copies, and the messages that carry it.

Multipliers are force densities, N/m^3: with the mass shares s_A, s_B of a particle a multiplier x slows the coarse copy by x/(rho s_A) and speeds the fine one
up by x/(rho s_B). They and the equations for them live where the fine copies are owned.
"""
import numpy as np

from pdhpc.conditions.loads import BodyForce
from pdhpc.conditions.time_functions import Constant
from pdhpc.kernels.overlap import break_bits, largest_elongation, mark_common, mark_intact, take_rows
from pdhpc.state import SUM, Entry, number


class Copies:
    """One region's copies of the particles of the overlap, and the multipliers that act on them.

    Attributes
    ----------
    slots : (n,) int32, owned copies of this rank in the order of the messages. share : (n,) of their mass. held : (n, dim) bool, prescribed components.
    mobility : (n, dim), m^3/kg, 1/(rho share), 0 where held. sign : -1 coarse, +1 fine. multiplier : (n, dim), N/m^3.
    """

    def __init__(self, subdomain, law, slots, share, held, sign):
        self.subdomain, self.law, self.slots, self.share, self.held, self.sign = subdomain, law, slots, share, held, sign
        density = law.density[subdomain.particles.block[slots]]
        self.mobility = np.where(held, 0.0, 1.0 / (density * share)[:, None])
        self.multiplier = np.zeros(held.shape)
        self._reaction = BodyForce(slots, np.zeros(held.shape), Constant())

    @property
    def ids(self):
        """(n,) int64, global ids of the copies."""
        return self.subdomain.particles.ids_at(self.slots)

    def add_to(self, force_density):
        """Add what the multipliers do to the copies to the force density of their region, N/m^3 of mass share. Local."""
        self._reaction.add_to(force_density, 0.0)

    def raise_multiplier(self, x):
        """multiplier += x (n, dim), N/m^3. Local."""
        self.set_multiplier(self.multiplier + x)

    def set_multiplier(self, value):
        """multiplier = value (n, dim), N/m^3. Local."""
        self.multiplier[...] = value
        np.multiply(self.multiplier, (self.sign / self.share)[:, None], out=self._reaction.vector)


class Interface:
    """Both regions' copies of the overlap and the exchange between their owners.

    Costs per rank 8 bytes a component for each of a dozen small arrays over its copies; messages go from owner to owner, none is collective over all ranks.
    """

    def __init__(self, exchange, coarse, fine):
        """exchange : GhostExchange whose owned rows are the coarse copies and whose ghosts are the fine ones. coarse, fine : Copies."""
        self.coarse, self.fine, self._exchange = coarse, fine, exchange
        self._n, dim = len(coarse.slots), coarse.held.shape[1]
        self.dim = dim
        self._motion = np.zeros((self._n + len(fine.slots), 2 * dim))
        self._bound_motion = exchange.bind(self._motion)
        self._vector = np.zeros((self._n + len(fine.slots), dim))
        self._bound_vector = exchange.bind(self._vector)
        self.coarse_mobility = self.to_fine(coarse.mobility)
        self._owned = np.zeros(len(fine.subdomain.particles.position), bool)
        self._owned[fine.subdomain.particles.slots] = True
        self.work, self._last_gap = 0.0, np.zeros_like(fine.multiplier)  # J, on this rank

    def to_fine(self, values):
        """Return values (n, dim) of the coarse copies as the owners of the fine ones see them. Collective over the owners of copies."""
        self._vector[: self._n] = values
        self._bound_vector.refresh()
        return self._vector[self._n :].copy()

    def to_coarse(self, values):
        """Return values (n, dim) of the fine copies as the owners of the coarse ones see them; valid until the next call. Collective over the owners of copies."""
        self._vector[: self._n] = 0.0
        self._vector[self._n :] = values
        self._bound_vector.accumulate()
        return self._vector[: self._n]

    def columns_to_fine(self, values):
        """As `to_fine`, of any number of columns; for those who look on. Collective over the owners of copies."""
        field = np.zeros((self._n + len(self.fine.slots), values.shape[1]))
        field[: self._n] = values
        bound = self._exchange.bind(field)
        bound.refresh()
        bound.free()
        return field[self._n :]

    def velocity_gap(self):
        """Return v_A - v_B, (n, dim) m/s, at the owners of the fine copies, and take note of u_A. Collective over the owners of copies."""
        dim, particles = self.dim, self.coarse.subdomain.particles
        take_rows(particles.velocity, self.coarse.slots, self._motion[: self._n], 0)
        take_rows(particles.displacement, self.coarse.slots, self._motion[: self._n], dim)
        self._bound_motion.refresh()
        fine, theirs = self.fine.subdomain.particles, self._motion[self._n :]
        return theirs[:, :dim] - fine.velocity[self.fine.slots]

    def displacement_gap(self):
        """Return u_A - u_B, (n, dim) m, at the owners of the fine copies, with the coarse displacements of the last `velocity_gap`. Local.

        A coarse region of one step does not change its displacements after that.
        """
        return self._motion[self._n :, self.dim :] - self.fine.subdomain.particles.displacement[self.fine.slots]

    def largest_gap(self):
        """Return (the largest |u_A - u_B|, the largest |u_j - u_i| over bonds of this rank's fine copies), m. Local."""
        domain, gap = self.fine.subdomain, self.displacement_gap()
        elongation = largest_elongation(domain.bonds.arrays, self.fine.slots, domain.particles.displacement, self._owned)
        return float(np.sqrt((gap**2).sum(axis=1).max(initial=0.0))), float(elongation)

    def raise_multipliers(self, x, coarse_x):
        """L += x at the fine and, coarse_x, at the coarse copies, N/m^3. Local.

        Their work in a macro step, -sum (L_n + L_{n+1})/2 V (g_{n+1} - g_n) with g = u_A - u_B, is added to `work`.
        """
        gap, fine = self.displacement_gap(), self.fine
        volume = fine.subdomain.particles.volume[fine.slots]
        self.work -= (fine.multiplier + 0.5 * x).ravel() @ ((gap - self._last_gap) * volume[:, None]).ravel()
        self._last_gap = gap
        fine.raise_multiplier(x)
        self.coarse.raise_multiplier(coarse_x)

    def state(self):
        """Return {key: Entry} of the multipliers, the accounts of their work, and the gap that goes with them."""
        entries = {f"multiplier/{name}": Entry(lambda c=c: c.multiplier, lambda value, c=c: c.set_multiplier(value), c.ids)
                   for name, c in (("coarse", self.coarse), ("fine", self.fine))}
        entries["multiplier/work"] = number(self, "work", of=SUM)
        entries["multiplier/gap"] = Entry(lambda: self._last_gap, lambda value: setattr(self, "_last_gap", np.array(value)), self.fine.ids)
        return entries

    def start_multipliers(self):
        """Set the multipliers that give both copies one acceleration: (q_A + q_B) L = a_A - a_B, with forces that hold none yet. Collective over the owners.

        The forces at hand then gain the multipliers' part.
        """
        fine, coarse = self.fine, self.coarse
        a_coarse = coarse.subdomain.particles.force_density[coarse.slots] * coarse.mobility * coarse.share[:, None]
        a_fine = fine.subdomain.particles.force_density[fine.slots] * fine.mobility * fine.share[:, None]
        total = self.coarse_mobility + fine.mobility
        start = (self.to_fine(a_coarse) - a_fine) / np.where(total > 0.0, total, 1.0)
        fine.set_multiplier(start)
        coarse.set_multiplier(self.to_coarse(start))
        for copies in (coarse, fine):
            copies.add_to(copies.subdomain.particles.force_density)


class CommonBonds:
    """The bonds that both regions hold: broken in either copy, they are broken in both from the end of the macro step on."""

    def __init__(self, exchange, coarse, fine, inside, n_words):
        """inside : of both regions, (n_slots,) bool, which slots hold a copy, ghosts too. n_words : of 64 bonds, the same on every rank."""
        self.coarse, self.fine, self._inside = coarse, fine, inside
        self._n = len(coarse.slots)
        self._words = np.zeros((self._n + len(fine.slots), n_words), np.uint64)
        self._bound = exchange.bind(self._words)
        self._masks = []
        for copies, marks in zip((coarse, fine), inside):
            mask = np.zeros((len(copies.slots), n_words), np.uint64)
            mark_common(copies.subdomain.bonds.arrays, copies.slots, marks, mask)
            self._masks.append(mask)
        self._own = [np.zeros_like(mask) for mask in self._masks]
        self._possible = [self._intact(0).copy(), self._intact(1).copy()]
        self._initial = self._possible
        self.mismatched = 0  # directed bonds that one copy broke and the other not, at the last macro end

    def take_initial(self):
        """Take the bonds that are intact now as those of the start: after pre-cracks. Local."""
        self._initial = [self._intact(0).copy(), self._intact(1).copy()]

    def _intact(self, number):
        copies = (self.coarse, self.fine)[number]
        mark_intact(copies.subdomain.bonds.arrays, copies.slots, self._inside[number], self._masks[number], self._own[number])
        return self._own[number]

    def unify(self):
        """Break in each copy what broke in the other, and take the forces of these bonds away; return how many that were here. Collective over the owners."""
        own = self._intact(0)
        self._words[: self._n] = own
        self._bound.refresh()
        mismatched = self._break(1, self._intact(1), self._words[self._n :])
        self._words[self._n :] &= self._own[1]
        self._words[: self._n] = 0
        self._bound.accumulate()
        mismatched += self._break(0, own, self._words[: self._n])
        self.mismatched = mismatched
        return mismatched

    def _break(self, number, here, there):
        copies, inside = (self.coarse, self.fine)[number], self._inside[number]
        domain, particles = copies.subdomain, copies.subdomain.particles
        return break_bits(
            domain.bonds.arrays, domain.shared, domain.points, copies.law, domain.state, particles.linear, particles.third, copies.slots, inside, here, there,
            particles.force_density, particles.dissipated,
        )

    def possible_counts(self):
        """Return (n,) common bonds of each coarse copy, broken or not. Local."""
        return _bits(self._possible[0])

    def initial_counts(self):
        """Return (n,) common bonds of each coarse copy that were intact at the start. Local."""
        return _bits(self._initial[0])

    def intact_counts(self):
        """Return (n,) intact common bonds of each coarse copy. Local."""
        return _bits(self._intact(0))

    def count_broken(self):
        """Return the directed common bonds of this rank's fine copies that broke since the start. Local."""
        return int((_bits(self._initial[1]) - _bits(self._intact(1))).sum())


def _bits(words):
    """Return (n,) numbers of set bits of words (n, n_words) uint64."""
    return np.unpackbits(words.view(np.uint8), axis=1).sum(axis=1, dtype=np.int64) if words.size else np.zeros(len(words), np.int64)
