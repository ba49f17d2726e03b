"""Energy ledger of the body: columns of history.csv."""
import math

from pdhpc.parallel.comm import exact_sum
from pdhpc.run import RunError
from pdhpc.state import number

NAMES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
OF_INTERACTIONS = ("contact_energy", "contact_loss", "impactor_energy")
"""Energy stored in contact and in impactors' penalties, lost to friction and damping, and kinetic energy of free impactors."""

_MOST_GAINED = 10.0  # times what was there and what was put in: no error of the books is so large
_CURE = "the step is too large, or the loads are; a smaller time.safety, or time.dt, shows which"


class Energies:
    """Kinetic, strain and dissipated energy, external work, and the balance error

        kinetic + strain + dissipated - external_work - (kinetic + strain at the start),

    with contact or impactors also contact_energy + contact_loss + impactor_energy. Sums over particles are exact, so that every digit is the same on any
    number of ranks.
    """

    def __init__(self, comm, more=(), rounding=0.0):
        """more : names of the ledger beside NAMES, which hold energy. rounding : J, below which energies are the rounding of positions."""
        self.comm, self.initial, self.latest, self.rounding = comm, None, {}, rounding
        self.names = NAMES + tuple(more)
        self.columns = tuple(f"{name} [J]" for name in self.names) + ("balance_error [J]", "broken_bonds")

    def read(self, stepper):
        """Return the values of the columns. Collective.

        Raises
        ------
        RunError: an energy that is not finite, or many times what was there and what was put in.
        """
        ledger = stepper.ledger()
        energies = {name: exact_sum(self.comm, ledger[name]) for name in self.names}
        stored = energies["kinetic_energy"] + energies["strain_energy"]
        for name in self.names[len(NAMES) :]:
            stored += energies[name]
        if self.initial is None:
            self.initial = stored + energies["dissipated_energy"] - energies["external_work"]
        error = stored + energies["dissipated_energy"] - energies["external_work"] - self.initial
        broken = self.comm.allreduce(stepper.broken) // 2
        self.latest = {**energies, "balance_error": error, "broken_bonds": int(broken)}
        self._check(stepper, energies, error)
        return [*energies.values(), error, broken]

    def _check(self, stepper, energies, error):
        """Stop a run whose energies show that it has gone wrong."""
        where = f"at step {stepper.step}, t = {stepper.time:.6g} s"
        for name, value in energies.items():
            if not math.isfinite(value):
                raise RunError(f"{name} is not finite {where}: {_CURE}")
        put_in = max(abs(self.initial), abs(energies["external_work"]), self.rounding)
        if abs(error) > _MOST_GAINED * put_in:
            raise RunError(f"the energy balance is off by {error:.4g} J {where}, where {put_in:.4g} J were put in: {_CURE}")

    def relative_error(self):
        """Return |balance error| over the largest of the energies, or 0 for a body at rest."""
        scale = max([abs(self.latest[name]) for name in self.names] + [abs(self.initial)])
        return abs(self.latest["balance_error"]) / scale if scale > self.rounding else 0.0

    def state(self):
        """Return {key: Entry} of the energy at the start."""
        return {"energies/initial": number(self, "initial")}
