import pytest

from pdhpc.observers.coupling import Coupling, CouplingGuard
from pdhpc.run import RunError
from pdhpc.study.verify.mts import coupled, shake


def test_ledger_of_the_coupling(comm):
    problem = coupled(4, "exact")
    shake(problem, 1e-3)
    stepper = problem.stepper()
    gauge = Coupling(comm, stepper)
    gauge.read(stepper)
    for _ in range(20):
        stepper.advance()
    row = dict(zip(gauge.columns, gauge.read(stepper)))
    assert gauge.relative_change() == pytest.approx(0.0, abs=1e-8) and row["conserved_quantity [J/s^2]"] > 0
    assert row["velocity_gap [m/s]"] < 1e-10 < row["displacement_gap [m]"] and row["interface_iterations"] >= 20 and row["load_imbalance"] == 1.0
    assert gauge.warnings() == []
    gauge.latest["broken_in_overlap"] = 7
    assert "7 bonds" in gauge.warnings()[0]


def test_a_growing_gap_or_energy_stops_the_run(comm):
    extra = '[[initial]]\nregion = "all"\nvelocity_gradient = [[1e-3, 0.0], [0.0, -1e-3]]\n'
    stepper = coupled(4, "polynomial", extra=extra).stepper()
    guard = CouplingGuard(comm, [])
    guard.start(stepper)
    stepper.advance()
    guard.observe(stepper)
    particles = stepper.coarse.subdomain.particles
    particles.put(particles.velocity, 2 * particles.owned(particles.velocity))
    with pytest.raises(RunError, match="the energy of the coupled regions"):
        guard.observe(stepper)
    particles.put(particles.velocity, 0.5 * particles.owned(particles.velocity))
    stepper.interface._motion[:, 2:] += 1.0
    with pytest.raises(RunError, match=r"copies of the overlap are .* apart"):
        guard.finish(stepper)


def test_a_failed_solve_stops_the_run(comm):
    stepper = coupled(4, "exact").stepper()
    guard = CouplingGuard(comm, [])
    guard.start(stepper)
    stepper.operator._solver.failure = "the KSP did not converge"
    with pytest.raises(RunError, match="by step 0, t = 0 s, the KSP did not converge"):
        guard.observe(stepper)
