"""Energy ledger of the body: columns of history.csv."""
from pdhpc.parallel.comm import exact_sum

NAMES = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")


class Energies:
    """Kinetic, strain and dissipated energy, external work, and the balance error

        kinetic + strain + dissipated - external_work - (kinetic + strain at the start).

    Sums over particles are exact, so that every digit is the same on any number of ranks.
    """

    columns = tuple(f"{name} [J]" for name in NAMES) + ("balance_error [J]", "broken_bonds")

    def __init__(self, comm):
        self.comm, self.initial, self.latest = comm, None, {}

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        ledger = stepper.ledger()
        energies = {name: exact_sum(self.comm, ledger[name]) for name in NAMES}
        stored = energies["kinetic_energy"] + energies["strain_energy"]
        if self.initial is None:
            self.initial = stored + energies["dissipated_energy"] - energies["external_work"]
        error = stored + energies["dissipated_energy"] - energies["external_work"] - self.initial
        broken = self.comm.allreduce(stepper.broken) // 2
        self.latest = {**energies, "balance_error": error, "broken_bonds": int(broken)}
        return [*energies.values(), error, broken]

    def relative_error(self):
        """Return |balance error| over the largest of the energies, or 0 for a body at rest."""
        scale = max([abs(self.latest[name]) for name in NAMES] + [abs(self.initial)])
        return abs(self.latest["balance_error"]) / scale if scale > 0 else 0.0

    def state(self):
        """Return {key: (getter, setter)} of the energy at the start."""
        return {"energies/initial": (lambda: self.initial, lambda value: setattr(self, "initial", float(value)))}
