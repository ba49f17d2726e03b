"""Linear forces near the overlap of the fine region: what the interface operators apply."""
import math

import numpy as np

from pdhpc.kernels import overlap as loops
from pdhpc.kernels import sweeps
from pdhpc.kernels.shared import row_width_of
from pdhpc.kernels.lattice import LatticeArrays
from pdhpc.parallel.noise import noise


class LinearForces:
    """-K w of a region at its reference configuration, with the bonds that are intact now: w by slot in, force density by slot out.

    A field costs 8 bytes for each component and slot of the region; there are two, and p of state-based laws.
    """

    def __init__(self, subdomain, law, bind):
        """bind : function field -> what refreshes its ghosts."""
        particles = subdomain.particles
        self.subdomain, self.law = subdomain, law._replace(break_at=np.full_like(law.break_at, np.inf))
        self.w, self.force_density = np.zeros_like(particles.position), np.zeros_like(particles.force_density)
        self._points = subdomain.points._replace(position=self.w)
        self._dissipated = np.zeros(0)
        self._refresh_w = bind(self.w[:, : particles.dim])
        self.state = None if subdomain.state is None else np.zeros_like(subdomain.state)
        self._refresh_p = None if self.state is None else bind(self.state[:, 1:2])
        arrays, shared = subdomain.bonds.arrays, subdomain.shared
        if isinstance(arrays, LatticeArrays):
            arrays = arrays._replace(trigger=np.full_like(arrays.trigger, np.inf))
        self._bonds = (arrays,) if shared is None else (arrays, shared._replace(bonds=arrays))

    def apply(self, rows, wider):
        """Store -K w in force_density in `rows` [plain rows, shared rows]; `wider`: those whose p is needed (state-based laws). Collective over neighbours."""
        self._refresh_w.refresh()
        if self._refresh_p is not None:
            self.state[:, 0] = self.subdomain.state[:, 0]
            self._sweep(sweeps.dilatations, wider)
            self._refresh_p.refresh()
        self._sweep(sweeps.bond_forces, rows, self.force_density)

    def _sweep(self, sweep, rows, *result):
        third = self.subdomain.particles.third
        for bonds, each in zip(self._bonds, rows):
            if len(each):
                sweep(bonds, self._points, self.law, self.state, True, third, each, *result, self._dissipated)

    def all_rows(self):
        """Return the rows of the whole region."""
        whole = [np.concatenate([self.subdomain.rows[0], self.subdomain.rows[1]])]
        return whole if self.subdomain.shared is None else whole + [np.concatenate(self.subdomain.shared_rows)]


def critical_step(subdomain, law, forces, allreduce, rounds=150):
    """Return the critical step 2/omega_max of a region, s, by power iteration on M^-1 K (from above: too large by a part in a thousand or so). Collective.

    forces : LinearForces of the region. allreduce : function that adds up arrays over its ranks.
    """
    particles, rows = subdomain.particles, forces.all_rows()
    density = law.density[particles.owned(particles.block)][:, None]
    mass = density if particles.mass_share is None else density * particles.mass_share[particles.slots][:, None]
    w, value = noise(particles.id[: particles.n_owned], particles.dim), 0.0
    for _ in range(rounds):
        forces.w[particles.slots, : particles.dim] = w
        forces.apply(rows, rows)
        new = -forces.force_density[particles.slots] / density
        sums = allreduce(np.array([(mass * w * w).sum(), (mass * w * new).sum(), (mass * new * new).sum()]))
        value = sums[1] / sums[0]
        if not sums[2] > 0.0:
            break
        w = new / math.sqrt(sums[2])
    forces.w[particles.slots] = 0.0
    return 2.0 / math.sqrt(value) if value > 0.0 else math.inf


class Strip:
    """The owned particles of the fine region by levels: level 0 is the overlap, level k + 1 all of level k and what is bonded to it.

    Attributes
    ----------
    slots : [(n,) int32] of each level. rows : [(plain rows, shared rows)] of each level.
    """

    def __init__(self, subdomain, overlap, levels, bind):
        """overlap : (n,) int32, slots of the owned copies. Collective over the region's ranks."""
        particles = subdomain.particles
        marked = np.zeros((len(particles.position), 1))
        marked[overlap] = 1.0
        ghosts, width = bind(marked), row_width_of(subdomain.bonds.arrays)
        self.slots, self.rows = [], []
        result = np.zeros_like(marked)
        for level in range(levels + 1):
            ghosts.refresh()
            here = np.sort(particles.slots[marked[particles.slots, 0] > 0.0])
            wanted = np.unique(here // width) * width
            both = [np.concatenate(subdomain.rows), np.concatenate(subdomain.shared_rows)]
            self.slots.append(here)
            self.rows.append([np.sort(rows[np.isin(rows, wanted)]) for rows in both])
            loops.spread_marks(subdomain.bonds.arrays, particles.slots, marked, result)
            marked[...] = result
        ghosts.free()

    def bonds_per_level(self, subdomain):
        """Return [directed bonds of a sweep over each level]."""
        order = np.argsort(subdomain.particles.slots)
        found = [order[np.searchsorted(subdomain.particles.slots, slots, sorter=order)] for slots in self.slots]
        return [int(subdomain.bonds.family_size[each].sum(dtype=np.int64)) for each in found]
