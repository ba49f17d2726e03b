"""Energy ledger of the body: columns of history.csv."""
from pdhpc.parallel.comm import exact_sum

NAMES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
OF_INTERACTIONS = ("contact_energy", "contact_loss", "impactor_energy")
"""Energy stored in contact and in impactors' penalties, lost to friction and damping, and kinetic energy of free impactors."""


class Energies:
    """Kinetic, strain and dissipated energy, external work, and the balance error

        kinetic + strain + dissipated - external_work - (kinetic + strain at the start),

    with contact or impactors also contact_energy + contact_loss + impactor_energy. Sums over particles are exact, so that every digit is the same on any
    number of ranks.
    """

    def __init__(self, comm, more=()):
        """more : names of the ledger beside NAMES, which hold energy."""
        self.comm, self.initial, self.latest = comm, None, {}
        self.names = NAMES + tuple(more)
        self.columns = tuple(f"{name} [J]" for name in self.names) + ("balance_error [J]", "broken_bonds")

    def read(self, stepper):
        """Return the values of the columns. Collective."""
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
        return [*energies.values(), error, broken]

    def relative_error(self):
        """Return |balance error| over the largest of the energies, or 0 for a body at rest."""
        scale = max([abs(self.latest[name]) for name in self.names] + [abs(self.initial)])
        return abs(self.latest["balance_error"]) / scale if scale > 0 else 0.0

    def state(self):
        """Return {key: (getter, setter)} of the energy at the start."""
        return {"energies/initial": (lambda: self.initial, lambda value: setattr(self, "initial", float(value)))}
