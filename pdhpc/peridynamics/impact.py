"""A rigid impactor against the particles of one rank: which are near, what it does to them, and what that does to it."""
import numpy as np

from pdhpc import state
from pdhpc.kernels import impact as kernels
from pdhpc.kernels.impact import Rigid, Struck
from pdhpc.peridynamics.watch import Watch


def _itself(values):
    """Return the values: what is near the impactor is each rank's own business."""
    return values


def rigid_of(impactor, friction=0.0, dt=0.0):
    """Return an Impactor as kernels see it, where it is now; dt : s."""
    dim = len(impactor.position)
    centre, velocity = np.zeros(3), np.zeros(3)
    centre[:dim], velocity[:dim] = impactor.position, impactor.velocity
    return Rigid(impactor.kind, centre, impactor.axis, velocity, impactor.radius, impactor.half_length, friction, dt)


def depths(impactor, points, radius):
    """Return (n,) m: how far balls of radius (n,) around points (n, dim), m, enter an Impactor; negative where they keep apart."""
    result = np.empty(len(points))
    kernels.find_depths(rigid_of(impactor), np.ascontiguousarray(points), radius, result)
    return result


class Impact:
    """Penalty contact of the particles of one rank with an Impactor (formulas: kernels/impact.py).

    A free impactor takes minus the sum of the forces on all ranks' particles, which is exact: 168 (dim + 1) bytes a step are summed over all ranks. One whose
    motion is prescribed needs no message.

    Attributes
    ----------
    impactor : Impactor, the same on every rank. loss : (n_owned,), J, by friction. work : (n_owned,), J, by a prescribed motion.
    """

    def __init__(self, subdomain, impactor, tables, friction, dt, sums):
        """tables : (radius (n_owned,), mass (n_owned,), stiffness (n_owned,)) of particles, m, kg, N/m^4. dt : s. sums : ExactSums of dim + 1, or None."""
        self.subdomain, self.impactor, self.friction, self.dt, self.sums = subdomain, impactor, friction, dt, sums
        self._radius, self._mass, self._stiffness = tables
        particles = subdomain.particles
        self.loss, self.work = np.zeros(particles.n_owned), np.zeros(particles.n_owned)
        self._skin = float(self._radius.max(initial=0.0))
        self.watch = Watch(particles, max(self._skin, 1e-300), dt, _itself)
        self._near, self._listed_at, self.lightest = np.zeros(particles.n_owned, np.bool_), impactor.position.copy(), np.inf
        self._given = None
        self._list()

    def add_to(self, force_density, t, broken):
        """Add the forces at the current positions to force_density, N/m^3. Collective over all ranks for a free impactor, else local."""
        particles, impactor = self.subdomain.particles, self.impactor
        if self.watch.due(float(np.linalg.norm(impactor.position - self._listed_at)), float(np.linalg.norm(impactor.velocity))):
            self._list()
        if self._given is not None:
            self._inelastic[:] = self._given[self._number]
        rigid = self._rigid()
        kernels.push(rigid, self._struck, particles.position, particles.velocity, force_density, self.applied, self._inelastic, self._given is not None)
        self._given = None
        if self.sums is not None:
            self.sums.clear()
            kernels.add_reaction(self._struck, self.applied, self.sums.places)
            *reaction, stiffness = self.sums.totals()
            impactor.force[:] = reaction
            self.lightest = min(self.lightest, (2.0 * impactor.mass / stiffness) ** 0.5) if stiffness > 0.0 else self.lightest

    def moved(self, dt):
        """Move the impactor to the end of the step, and account for the work of the forces at its start. Local."""
        self.impactor.move(dt)
        self._account(dt)

    def worked(self, dt):
        """Account for the work of the forces at the step's end, and take the impactor's velocity there. Local."""
        self._account(dt)
        self.impactor.settle(dt)

    def ledger(self):
        """Return {"contact_energy", "contact_loss", "impactor_energy"}: (n,) J of this rank. Local."""
        energy, particles = np.zeros(len(self._struck.slot)), self.subdomain.particles
        kernels.stored(self._rigid(), self._struck, particles.position, particles.dim, energy)
        return {"contact_energy": energy, "contact_loss": self.loss, "impactor_energy": self._once(self.impactor.kinetic_energy)}

    def external_work(self):
        """Return [(n,) J]: the work of a prescribed motion, or of gravity on a free impactor."""
        return [self._once(self.impactor.gravity_work)] if self.impactor.free else [self.work]

    def forces(self):
        """Return (n, dim) forces on this rank's particles, N; their sum over ranks is that on the body. Local."""
        return self.applied

    def warnings(self):
        """Return sentences on what the run should know: particles that may have been missed, a step too large for a light impactor."""
        name, found = self.impactor.name, []
        if self.watch.overrun > 1.0:
            found.append(f"impactor '{name}': something moved {self.watch.overrun:.2f} of half the skin, {0.5 * self._skin:.3g} m, before near particles were listed anew: "
                         "some may have been missed where speeds more than doubled within 10 steps")
        if self.dt > self.lightest:
            found.append(f"impactor '{name}': its mass and the penalty of the particles it touched lowered the critical step to {self.lightest:.4g} s, "
                         f"below dt = {self.dt:.4g} s; a smaller step or stiffness, or more mass, would keep it above")
        return found

    def state(self):
        """Return {key: Entry}: the impactor, the accounts, and the last forces of friction, N, which velocities of a half step that is gone decided.

        Once they are set, near particles are found anew, and the next forces take friction as given.
        """
        particles, name = self.subdomain.particles, self.impactor.name
        ids = particles.id[: particles.n_owned]
        entries = {f"impactor/{name}/{key}": state.rows(getattr(self, key), ids) for key in ("loss", "work")}
        entries[f"impactor/{name}/inelastic"] = state.Entry(self._friction, self._resume, ids)
        return {**entries, **self.impactor.state()}

    def _friction(self):
        """Return (n_owned, dim), N."""
        result = np.zeros((self.subdomain.particles.n_owned, self.subdomain.particles.dim))
        result[self._number] = self._inelastic
        return result

    def _resume(self, value):
        self._given = np.array(value)
        self.watch.restart()

    @property
    def bytes_sent(self):
        """Bytes that this rank contributes to the sum over all ranks at an evaluation."""
        return 0 if self.sums is None else self.sums.places.nbytes

    def _once(self, value):
        """Return a number that only one rank counts."""
        return np.array([value] if self.sums is not None and self.sums.comm.rank == 0 else [])

    def _rigid(self):
        return rigid_of(self.impactor, self.friction, self.dt)

    def _list(self):
        """List the particles within the skin of the impactor. Local."""
        particles = self.subdomain.particles
        kernels.find_near(self._rigid(), particles.position, particles.dim, particles.slots, self._radius, self._skin, self._near)
        number = np.flatnonzero(self._near)
        slot = particles.slots[number]
        self._struck = Struck(slot, self._radius[number], np.ascontiguousarray(particles.volume[slot]), self._mass[number], self._stiffness[number])
        self._number, self.applied, self._inelastic = number, np.zeros((len(number), particles.dim)), np.zeros((len(number), particles.dim))
        self._listed_at[:] = self.impactor.position

    def _account(self, dt):
        particles, impactor = self.subdomain.particles, self.impactor
        rigid = self._rigid()
        kernels.account(self._struck, self._number, self.applied, self._inelastic, particles.velocity, rigid.velocity, 0.5 * dt, not impactor.free, self.work, self.loss)
