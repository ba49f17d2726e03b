"""Contact between particles that are not bonded: which pairs are near as bodies move, across ranks, and the forces between them."""
import math

import numpy as np

from pdhpc.kernels import contact as kernels
from pdhpc.kernels.contact import Crowd, MetPoints, Pairs
from pdhpc.kernels.neighbours import cell_list
from pdhpc.peridynamics.watch import Watch
from pdhpc.state import Entry


class Contact:
    """Short-range repulsion, friction and damping between the particles of one rank and whatever comes near them (formulas: kernels/contact.py).

    A list holds the pairs within d_ij + a_i + a_j of each other, those joined by intact bonds too where bonds can break: a pair takes part from the evaluation in
    which its bond breaks. It is made anew when a particle moved farther than its allowance a_i, half the skin or more where it is fast (see Watch). Ranks then tell each other the boxes of their particles, send
    candidates where these meet, and set up a second ghost exchange for what is near in the current configuration.

    Memory per particle, most of it while a list is made: 160 (2D) or 230 (3D) bytes; where bonds can break 44 or 108 more, since then bonded neighbours are in
    the list; with friction or damping 32 or 60 more.
    """

    def __init__(self, subdomain, bond_law, law, reach, vicinity, skin):
        """bond_law : of materials/. law : ContactLaw. reach : function (volume (n,)) -> (n,) m, half the distance of contact of particles. skin : m."""
        self.subdomain, self.bond_law, self.law, self.reach, self.vicinity, self.skin = subdomain, bond_law, law, reach, vicinity, skin
        particles = subdomain.particles
        self.resists = law.friction > 0.0 or law.damping > 0.0
        self.breaks = bool(np.isfinite(bond_law.break_at).any())
        self.inelastic = np.zeros_like(particles.force_density) if self.resists else None
        self.loss = np.zeros(particles.n_owned)
        touching = 2.0 * float(reach(particles.owned(particles.volume)).max(initial=0.0))
        self.watch = Watch(particles, skin, law.dt, vicinity.agree, touching)
        self.lists_made, self.stable_dt = 0, math.inf
        self._bound = None
        self._stamp = np.zeros(len(particles.position), np.bool_)
        self._forget()
        self._intact = np.empty(particles.n_owned, np.int32)
        self._broken, self._rows, self._given = -1, np.empty(0, np.int64), False
        order = np.argsort(particles.id[particles.n_owned :], kind="stable")
        self._known = particles.id[particles.n_owned :][order], particles.ghost_slots[order]

    @property
    def ghosts(self):
        """Particles of other ranks that are near this rank's ones."""
        return len(self._points.motion) - self.subdomain.particles.n_owned if self.lists_made else 0

    @property
    def near_pairs(self):
        """Pairs in the list of this rank."""
        return len(self._pairs.other)

    def add_to(self, force_density, t, broken):
        """Add the contact forces at the current positions to force_density, N/m^3. Collective over neighbours; over all ranks when Watch looks.

        broken : directed bonds of this rank that broke so far.
        """
        if self.watch.due(measure=self.measure_stiffness):
            self._make_list()
        elif broken != self._broken:
            self._free_pairs()
        self._broken = broken
        if self.watch.largest > 0.0:
            self.stable_dt = min(self.stable_dt, math.sqrt(2.0 / self.watch.largest))
        particles = self.subdomain.particles
        kernels.gather(particles.position, particles.velocity, particles.slots, self._met, particles.dim, self._points.motion)
        if self._bound is not None:
            self._bound.refresh()
        kernels.add_contact_forces(self._pairs, self._points, self.law, particles.third, self._rows, force_density, self.inelastic, self._given)
        self._given = False

    def moved(self, dt):
        """Account for the work of the forces at the step's start; the velocity is that of the half step. Local."""
        if self.resists:
            particles = self.subdomain.particles
            kernels.lose(self.inelastic, particles.velocity, particles.slots, self._rows, 0.5 * dt, self.loss)

    worked = moved  # the forces at the step's end, with the same velocity

    def measure_stiffness(self):
        """Return the largest |A|/rho of bonds and contact together, 1/s^2, of this rank's touching particles at their last positions. Local."""
        if not self.lists_made:
            return 0.0
        domain = self.subdomain
        third, bonds = domain.particles.third, domain.bonds.arrays
        return kernels.stiffest(self._pairs, self._points, self.law, third, self._rows, bonds, domain.points, self.bond_law, domain.state)

    def ledger(self):
        """Return {"contact_energy", "contact_loss"}: (n,) J of this rank's particles. Local."""
        energy = np.zeros(self.subdomain.particles.n_owned)
        kernels.contact_energies(self._pairs, self._points, self.law, self.subdomain.particles.third, self._rows, energy)
        return {"contact_energy": energy, "contact_loss": self.loss}

    def external_work(self):
        """Return no work: contact is between particles."""
        return []

    @property
    def bytes_sent(self):
        """Bytes that this rank sends at an evaluation."""
        return 0 if self._bound is None else self._bound.bytes_sent

    def warnings(self):
        """Return sentences on what the run should know: pairs that may have been missed, a step that contact made too large."""
        found = []
        if self.watch.overrun > 1.0:
            found.append(f"contact: particles moved {self.watch.overrun:.2f} of half the skin, {0.5 * self.skin:.3g} m, before near pairs were listed anew: "
                         "pairs may have been missed where speeds more than doubled within 10 steps")
        if self.law.dt > self.stable_dt:
            found.append(f"contact: pairs pressed together lowered the critical step (a lower bound) to {self.stable_dt:.4g} s, below dt = {self.law.dt:.4g} s; "
                         "a smaller time.safety or contact.stiffness would keep it above")
        return found

    def state(self):
        """Return {key: Entry}: losses, and the last forces of friction and damping, N, which velocities of a half step that is gone decided.

        Once they are set, pairs are found anew, and the next forces take friction and damping as given.
        """
        particles = self.subdomain.particles
        ids = particles.id[: particles.n_owned]
        entries = {"contact/loss": Entry(lambda: self.loss, self._resume_loss, ids)}
        if self.resists:
            entries["contact/inelastic"] = Entry(lambda: particles.owned(self.inelastic), self._resume_inelastic, ids)
        return entries

    def _resume_loss(self, value):
        np.copyto(self.loss, value)
        self.watch.restart()

    def _resume_inelastic(self, value):
        self.subdomain.particles.put(self.inelastic, value)
        self._given = True

    def _make_list(self):
        """Find the near pairs of this rank's particles, and set up the exchange of those of other ranks. Collective."""
        n, dim = self.subdomain.particles.n_owned, self.subdomain.particles.dim
        room = self.near_pairs + 1024
        self._forget()
        rows = self._rows_to_send(dim)
        most = np.array([self.reach(rows[:, 2 * dim]).max(initial=0.0), self.watch.allowance.max(initial=0.0)])
        distance, allowance = 2.0 * self.vicinity.agree(most)
        others, owners = self.vicinity.gather_near(rows, dim, (distance + allowance) * kernels.SEAM)
        rows = np.concatenate([rows, others]) if len(others) else rows
        points, ids, allowance = self._points_of(rows, dim), rows[:, -1].astype(np.int64), np.ascontiguousarray(rows[:, -2])
        del rows, others
        start, other = self._near(points, ids, allowance, distance, room)
        used = np.zeros(len(ids), bool)
        used[other], used[:n] = True, True
        if not used.all():
            other, points = (np.cumsum(used) - 1).astype(np.int32)[other], MetPoints(*(np.ascontiguousarray(field[used]) for field in points))
        self._points = points if not self.resists else points._replace(motion=np.zeros((len(points.motion), 2 * dim)))
        self._pairs = Pairs(start, other, np.ones(len(other), np.uint8))
        self._connect(ids[used], owners[used[n:]])
        self.lists_made += 1
        self._intact[:] = -1
        self._has_free, self._seen = np.diff(start) > 0, np.zeros(len(points.volume), bool)
        if not self.breaks:
            kernels.mark_met(self._pairs, np.flatnonzero(self._has_free), self._seen)
        self._free_pairs()

    def _forget(self):
        """Let go of the last list and its exchange, so that two are never held at once. Local."""
        if self._bound is not None:
            self._bound.free()
        self._bound = self._points = None
        self._pairs = Pairs(np.zeros(1, np.int64), np.empty(0, np.int32), np.empty(0, np.uint8))

    def _rows_to_send(self, dim):
        """Return (n_owned, 2 dim + 4): position and reference position, m, volume, m^3, block, allowance, m, id. Local."""
        particles = self.subdomain.particles
        rows = np.empty((particles.n_owned, 2 * dim + 4))
        rows[:, :dim] = particles.owned(particles.position)[:, :dim]
        rows[:, dim : 2 * dim] = self.subdomain.places()
        rows[:, 2 * dim], rows[:, 2 * dim + 1] = particles.owned(particles.volume), particles.owned(particles.block)
        rows[:, 2 * dim + 2], rows[:, 2 * dim + 3] = self.watch.allowance, particles.id[: particles.n_owned]
        return rows

    def _points_of(self, rows, dim):
        """Return the MetPoints of rows (see _rows_to_send), owned particles first."""
        particles = self.subdomain.particles
        n = particles.n_owned
        slot = np.full(len(rows), -1, np.int32)
        slot[:n] = particles.slots
        ids, slots = self._known
        if len(ids) and len(rows) > n:
            wanted = rows[n:, -1].astype(np.int64)
            at = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
            slot[n:] = np.where(ids[at] == wanted, slots[at], -1)
        volume = np.ascontiguousarray(rows[:, 2 * dim])
        return MetPoints(np.ascontiguousarray(rows[:, :dim]), np.ascontiguousarray(rows[:, dim : 2 * dim]), self.reach(volume), volume,
                         rows[:, 2 * dim + 1].astype(np.uint8), slot)

    def _near(self, points, ids, allowance, distance, room):
        """Return (start, other) of the pairs within d_ij + a_i + a_j, without those that bonds which never break join; room : for how many to begin with. Local.

        Fast particles, of a larger allowance than the skin's, are sought apart: they are few, and others need not look as far for each other.
        """
        fast = allowance > self.watch.half
        crowds = tuple(self._crowd(points, allowance, np.flatnonzero(some).astype(np.int32), distance) for some in (~fast, fast))
        bonds, third = self.subdomain.bonds.arrays, self.subdomain.particles.third
        start, end = np.zeros(self.subdomain.particles.n_owned + 1, np.int64), room
        while True:
            other = np.empty(end + end // 8, np.int32)
            end = kernels.list_near(crowds, distance, points, allowance, ids, third, bonds, not self.breaks, self._stamp, start, other)
            if end <= len(other):
                return start, other[:end].copy()

    def _crowd(self, points, allowance, members, distance):
        """Return the Crowd of the points `members` (n,). Local."""
        largest = float(allowance[members].max(initial=0.0))
        cells = cell_list(points.motion[members], distance + largest + self.watch.half, 1)
        return Crowd(cells._replace(order=members[cells.order]), largest)

    def _connect(self, ids, owners):
        """Set up the exchange of the particles `ids` (n_points,), ghosts behind the owned ones. Collective."""
        n = self.subdomain.particles.n_owned
        exchange = self.vicinity.exchange(ids[:n], ids[n:], owners)
        self._bound = exchange.bind(self._points.motion) if len(self._points.motion) else None

    def _free_pairs(self):
        """Let the pairs take part whose bonds broke, and list the particles that then do, whose motion alone is looked at and sent. Local.

        A bond breaks at both of its ends in one evaluation, so that owners know which of their particles other ranks look at.
        """
        domain = self.subdomain
        if self.breaks:
            kernels.free_pairs(domain.bonds.arrays, self._pairs, self._points, self._stamp, self._intact, self._has_free, self._seen)
        self._rows, self._met = np.flatnonzero(self._has_free), np.flatnonzero(self._seen[: domain.particles.n_owned])
