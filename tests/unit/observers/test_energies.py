import numpy as np
import pytest

from pdhpc.observers.energies import Energies


class Stepper:
    broken = 6

    def __init__(self, **energies):
        self.energies = energies

    def ledger(self):
        zero = dict.fromkeys(("kinetic_energy", "strain_energy", "dissipated_energy", "external_work"), 0.0)
        return {name: np.array([value, 0.0]) for name, value in {**zero, **self.energies}.items()}


def test_balance_error(comm):
    energies = Energies(comm)
    energies.read(Stepper(kinetic_energy=2.0, strain_energy=1.0))
    row = dict(zip(energies.columns, energies.read(Stepper(kinetic_energy=3.0, strain_energy=2.5, dissipated_energy=0.5, external_work=2.75))))
    assert row["balance_error [J]"] == pytest.approx(3.0 + 2.5 + 0.5 - 2.75 - 3.0)
    assert row["broken_bonds"] == 3, "each bond is counted by both of its owners"
    assert energies.relative_error() == pytest.approx(0.25 / 3.0)


def test_a_body_at_rest_has_no_error(comm):
    energies = Energies(comm)
    energies.read(Stepper())
    assert energies.relative_error() == 0.0


def test_the_start_is_state(comm):
    energies, other = Energies(comm), Energies(comm)
    energies.read(Stepper(kinetic_energy=2.0))
    (get, _), (_, put) = energies.state()["energies/initial"], other.state()["energies/initial"]
    put(get())
    assert other.read(Stepper(kinetic_energy=2.0))[4] == 0.0
