import numpy as np
import pytest

from pdhpc.observers.energies import Energies
from pdhpc.run import RunError


class Stepper:
    broken, step, time = 6, 40, 2e-6

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


def test_energies_of_rounding_have_no_error(comm):
    energies = Energies(comm, rounding=1e-20)
    energies.read(Stepper())
    energies.read(Stepper(strain_energy=3e-26))
    assert energies.latest["balance_error"] == 3e-26 and energies.relative_error() == 0.0


@pytest.mark.parametrize("now, words", [
    ({"kinetic_energy": float("nan")}, "kinetic_energy is not finite at step 40, t = 2e-06 s"),
    ({"strain_energy": 1e300}, "off by 1e\\+300 J at step 40, t = 2e-06 s, where 3 J were put in"),
    ({"kinetic_energy": 36.0, "external_work": 2.0}, "off by 31 J .* where 3 J were put in"),
])
def test_energies_that_come_from_nowhere_stop_the_run(comm, now, words):
    energies = Energies(comm)
    energies.read(Stepper(kinetic_energy=3.0))
    energies.read(Stepper(kinetic_energy=30.0))
    with pytest.raises(RunError, match=words):
        energies.read(Stepper(**now))


def test_the_start_is_state(comm):
    energies, other = Energies(comm), Energies(comm)
    energies.read(Stepper(kinetic_energy=2.0))
    (get, *_), (_, put, *_) = energies.state()["energies/initial"], other.state()["energies/initial"]
    put(get())
    assert other.read(Stepper(kinetic_energy=2.0))[4] == 0.0
