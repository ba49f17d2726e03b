"""Internal forces of one subdomain: sweeps over the interior while messages travel, then over the border."""
import time

from pdhpc.kernels import sweeps


class InternalForces:
    """f(u) and the breaking of bonds, in one or two sweeps:

        refresh positions of ghosts;  state-based laws: p_i of each particle, refresh p of ghosts;  f_i.

    Attributes
    ----------
    seconds : {"force", "exchange", "wait"}: in sweeps, packing and posting messages, and waiting for them.
    """

    def __init__(self, subdomain, law, bind):
        """bind : function field -> what refreshes its ghosts (start_refresh, finish_refresh), such as GhostExchange.bind."""
        self.subdomain, self.law = subdomain, law
        self.seconds = {"force": 0.0, "exchange": 0.0, "wait": 0.0}
        particles = subdomain.particles
        self._positions = bind(particles.position[:, : particles.dim])
        self._pressures = None if subdomain.state is None else bind(subdomain.state[:, 1:2])

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per evaluation."""
        return sum(ghosts.bytes_sent for ghosts in (self._positions, self._pressures) if ghosts is not None)

    def evaluate(self):
        """Store the force densities of the owned particles; return the number of directed bonds that broke. Collective over neighbours."""
        if self._pressures is None:
            return self._sweep(self._positions, sweeps.bond_forces, self.subdomain.particles.force_density)
        broken = self._sweep(self._positions, sweeps.dilatations)
        return broken + self._sweep(self._pressures, sweeps.bond_forces, self.subdomain.particles.force_density)

    def _sweep(self, ghosts, sweep, *result):
        """Do one sweep, its border rows with fresh ghosts."""
        interior, border = self.subdomain.rows
        started = time.perf_counter()
        ghosts.start_refresh()
        sent = time.perf_counter()
        broken = self._rows(sweep, interior, *result)
        swept = time.perf_counter()
        ghosts.finish_refresh()
        received = time.perf_counter()
        broken += self._rows(sweep, border, *result)
        self.seconds["exchange"] += sent - started
        self.seconds["wait"] += received - swept
        self.seconds["force"] += swept - sent + time.perf_counter() - received
        return broken

    def _rows(self, sweep, rows, *result):
        domain, particles = self.subdomain, self.subdomain.particles
        return sweep(domain.bonds.arrays, domain.points, self.law, domain.state, particles.linear, particles.third, rows, *result, particles.dissipated)
