"""Internal forces of one subdomain: sweeps over the interior while messages travel, then over the border."""
import time

from pdhpc.kernels import sweeps


class InternalForces:
    """f(u) and the breaking of bonds, in one or two sweeps:

        refresh positions of ghosts;  state-based laws: p_i of each particle, refresh p of ghosts;  f_i.

    Where compression raises critical stretches, a sweep for these and their message come first.

    Attributes
    ----------
    seconds : {"force", "exchange", "wait"}: in sweeps, packing and posting messages, and waiting for them.
    broken : directed bonds of this rank that broke so far. bond_evaluations : directed bonds evaluated so far (both sweeps of a state-based law count as one).
    """

    def __init__(self, subdomain, law, bind):
        """bind : function field -> what refreshes its ghosts (start_refresh, finish_refresh), such as GhostExchange.bind."""
        self.subdomain, self.law = subdomain, law
        self.broken, self.bond_evaluations = 0, 0
        self.seconds = {"force": 0.0, "exchange": 0.0, "wait": 0.0}
        particles = subdomain.particles
        self._positions = bind(particles.position[:, : particles.dim])
        self._pressures = None if subdomain.state is None else bind(subdomain.state[:, 1:2])
        self._limits = bind(subdomain.points.raised.reshape(-1, 1)) if len(subdomain.points.raised) else None

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per evaluation."""
        return sum(ghosts.bytes_sent for ghosts in (self._positions, self._pressures, self._limits) if ghosts is not None)

    def evaluate(self):
        """Store the force densities of the owned particles; return the number of directed bonds that broke. Collective over neighbours."""
        before = self.broken
        for _ in self.pieces(1):
            pass
        return self.broken - before

    def pieces(self, count):
        """As `evaluate`, in about `count` pieces of equal work: a generator that yields after each, so that other work goes on in between.

        The number of yields depends on `count` alone: ranks that mix pieces with other exchanges in one order cannot wait for each other for ever.
        """
        force_density, fresh = self.subdomain.particles.force_density, self._positions
        if self._limits is not None:
            yield from self._sweep(1, self._positions, sweeps.smallest_stretches)
            fresh = self._limits
        if self._pressures is None:
            yield from self._sweep(count, fresh, sweeps.bond_forces, force_density)
        else:
            yield from self._sweep(max(1, count // 2), fresh, sweeps.dilatations)
            yield from self._sweep(max(1, count - count // 2), self._pressures, sweeps.bond_forces, force_density)
        self.bond_evaluations += self.subdomain.bonds.n_directed

    def refresh(self):
        """Bring the ghosts' positions, and what state-based laws need of them, up to date with the owners', for those who look on. Collective over neighbours."""
        self._positions.refresh()
        if self._pressures is not None:
            self._pressures.refresh()

    def _sweep(self, count, ghosts, sweep, *result):
        """Do one sweep, its border rows with fresh ghosts; yields `count` times."""
        started = time.perf_counter()
        ghosts.start_refresh()
        sent = time.perf_counter()
        self.seconds["exchange"] += sent - started
        for piece in range(count):
            self._rows(0, piece, count, sweep, *result)
            yield
        swept = time.perf_counter()
        ghosts.finish_refresh()
        self.seconds["wait"] += time.perf_counter() - swept
        self._rows(1, 0, 1, sweep, *result)

    def _rows(self, part, piece, count, sweep, *result):
        """Sweep over one of `count` pieces of the interior (part 0) or the border (1)."""
        started = time.perf_counter()
        domain, particles = self.subdomain, self.subdomain.particles
        for bonds, rows in domain.groups(part):
            rows = rows[len(rows) * piece // count : len(rows) * (piece + 1) // count]
            self.broken += sweep(bonds, domain.points, self.law, domain.state, particles.linear, particles.third, rows, *result, particles.dissipated)
        self.seconds["force"] += time.perf_counter() - started
