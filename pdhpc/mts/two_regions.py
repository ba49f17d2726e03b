"""What every stepper of a coarse and a fine region has: time, energies, state, and who looks on."""
from time import perf_counter

import numpy as np

from pdhpc.state import number


class TwoRegions:
    """A coarse region with one step dt and a fine one with m steps dt/m in it.

    Attributes
    ----------
    coarse, fine : VelocityVerlet. m : step ratio. dt : macro step, s. view : what observers see, see mts/view.py.
    seconds : {name: wall seconds on this rank}.
    """

    def __init__(self, coarse, fine, m):
        self.coarse, self.fine, self.m = coarse, fine, m
        self.dt, self.step = coarse.dt, 0
        self.view = None
        self._interface_seconds = {"interface": 0.0, "interface_wait": 0.0}

    @property
    def time(self):
        """Time of the current state, s."""
        return self.step * self.dt

    @property
    def parts(self):
        """The subdomains of this rank."""
        return self.coarse.subdomain, self.fine.subdomain

    @property
    def broken(self):
        """Directed bonds that broke so far, each of both regions counted once. Collective over the owners of copies."""
        return self.view.broken()

    @property
    def seconds(self):
        """Wall seconds of this rank by kind of work, both regions together."""
        return {**{name: self.coarse.seconds[name] + self.fine.seconds[name] for name in self.coarse.seconds}, **self._interface_seconds}

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per macro step to refresh ghosts."""
        return self.coarse.bytes_sent + self.m * self.fine.bytes_sent

    @property
    def bond_evaluations(self):
        """Directed bonds that this rank evaluated so far: {"coarse", "fine", "interface"}."""
        return {"coarse": self.coarse.internal.bond_evaluations, "fine": self.fine.internal.bond_evaluations, "interface": 0}

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies; sums over all ranks are the body's. Local (view.prepare must have been called)."""
        both = self.coarse.ledger(), self.fine.ledger()
        return {name: np.concatenate([each[name] for each in both]) for name in both[0]}

    def state(self):
        """Return {key: Entry} of everything a continued run needs; after the last is set, `resume`."""
        entries = {"step": number(self, "step", int)}
        for region, stepper in (("coarse", self.coarse), ("fine", self.fine)):
            particles = stepper.subdomain.particles
            entries.update({f"{region}/{key}": entry for key, entry in stepper.state().items()})
            entries[f"{region}/force_density"] = particles.entry(particles.force_density)  # after a link pass no function of the displacements alone
        return entries

    def resume(self):
        """Bring everything that follows from the state up to date, after a state was put in. Collective over neighbours."""
        for stepper in (self.coarse, self.fine):
            stepper.resume(keep_forces=True)


class Timer:
    """Adds the seconds of a block to an account."""

    def __init__(self, seconds, name):
        self._seconds, self._name = seconds, name

    def __enter__(self):
        self._started = perf_counter()

    def __exit__(self, *error):
        self._seconds[self._name] += perf_counter() - self._started
