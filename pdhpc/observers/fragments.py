"""Fragments: what holds together by intact bonds, counted over all ranks."""
from functools import partial

import numpy as np

from pdhpc.parallel.comm import exact_sum, largest
from pdhpc.peridynamics.pieces import label_pieces

_UNITS = 2**52  # of the body's mass: sums of whole units are the same on any number of ranks
_LISTED = 100  # fragments in run.json, the heaviest


class Fragments:
    """The sets of particles that intact bonds join, without particles of more than a given damage: they are dust.

    Sums over a fragment are made on the rank that its id falls to.
    """

    columns = ("fragments", "fragments.largest [1]", "fragments.dust [1]")

    def __init__(self, comm, settings, part, density):
        """settings : scene.Fragments (damage, particles). part : scene.Part. density (n_block,), kg/m^3. Collective."""
        self.comm, self.settings, self._subdomain, self._exchange = comm, settings, part.subdomain, part.exchange
        particles = part.subdomain.particles
        mass = density[particles.owned(particles.block)] * particles.owned(particles.volume)
        self.mass = exact_sum(comm, mass)  # kg, of the body
        self._units = np.rint(mass / self.mass * _UNITS).astype(np.int64)
        self._all = int(comm.allreduce(int(self._units.sum())))
        self._latest = None, None

    def labels(self):
        """Return (n_owned,) int64: the lowest id of each particle's set, -1 for dust. Collective."""
        whole = self._subdomain.bonds.damage() <= self.settings.damage
        return label_pieces(self._subdomain, self._exchange.bind, partial(largest, self.comm), whole)

    def find(self, stepper):
        """Return {"count", "largest", "dust", "heaviest": [{"id", "particles", "mass" (kg)}]}: shares of the mass, 1. Collective."""
        if self._latest[0] == stepper.step:
            return self._latest[1]
        label = self.labels()
        whole = label >= 0
        ids, number = np.unique(label[whole], return_inverse=True)
        counts = np.bincount(number, minlength=len(ids)).astype(np.int64)
        units = np.zeros(len(ids), np.int64)
        np.add.at(units, number, self._units[whole])
        ids, counts, units = self._gathered(ids, counts, units)
        kept = counts >= self.settings.particles
        ids, counts, units = ids[kept], counts[kept], units[kept]
        count, mass = (int(total) for total in self.comm.allreduce(np.array([len(ids), units.sum()], np.int64)))
        order = np.lexsort((ids, -units))[:_LISTED]
        rows = self.comm.allgather(np.stack([-units[order], ids[order], counts[order]], axis=1).tolist())
        rows = sorted(row for each in rows for row in each)[:_LISTED]  # the heaviest first
        heaviest = [{"id": name, "particles": n, "mass": -negative / self._all * self.mass} for negative, name, n in rows]
        found = {"count": count, "largest": -rows[0][0] / self._all if rows else 0.0, "dust": (self._all - mass) / self._all, "heaviest": heaviest}
        self._latest = stepper.step, found
        return found

    def _gathered(self, ids, counts, units):
        """Return (ids, counts, units) of the sets whose ids fall to this rank, summed over all ranks. Collective."""
        home = ids % self.comm.size
        pieces = self.comm.alltoall([np.stack([ids, counts, units])[:, home == rank] for rank in range(self.comm.size)])
        rows = np.concatenate(pieces, axis=1)
        mine, number = np.unique(rows[0], return_inverse=True)
        sums = np.zeros((2, len(mine)), np.int64)
        for total, values in zip(sums, rows[1:]):
            np.add.at(total, number, values)
        return mine, *sums

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        found = self.find(stepper)
        return [found["count"], found["largest"], found["dust"]]
