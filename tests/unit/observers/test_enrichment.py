import numpy as np
import pytest

from pdhpc.observers.enrichment import Enrichment, EnrichmentGuard
from pdhpc.run import RunError

STEP = ("time.dt=2.4", "time.end=60.0")


def test_ledger_of_the_enrichment(coupled_body, shake, comm):
    problem = coupled_body(STEP)
    stepper = shake(problem.stepper(), 1e-2)
    gauge = Enrichment(comm, stepper)
    stepper.advance()
    row = dict(zip(gauge.columns, gauge.read(stepper)))
    chosen = int(stepper.patches.chosen.sum())
    assert row["active_share"] == len(stepper.local.points.slots) / 384 and row["patches"] == row["enriched_x"] == row["enriched_y"] == chosen
    ledger = stepper.ledger()
    assert row["energy_elements [J]"] == pytest.approx(stepper.solution.kinetic_energies().sum() + stepper.solution.strain_energies().sum(), rel=1e-12)
    assert row["energy_elements [J]"] + row["energy_particles [J]"] == pytest.approx(ledger["kinetic_energy"].sum() + ledger["strain_energy"].sum(), rel=1e-12)
    assert row["mass_iterations"] == 0 and row["mass_condition"] == 1.0 and row["projection_loss [J]"] == 0.0
    assert row["ghost_force"] == stepper.ghost_force() and gauge.summary()["ghost_force"] == row["ghost_force"] and gauge.warnings() == []
    assert problem.coupled(stepper, comm, gauge)["active_share"] == row["active_share"]


def test_vertices_that_cannot_join_are_named(coupled_body, comm):
    """Cells of 4 that touch x = 12, where motion is prescribed, and with them the vertices at x = 8, stay elements: 10 are wanted and refused."""
    held = '[[region]]\nname = "end"\nshape = "box"\nlower = [11.5, -8.0]\nupper = [12.5, 8.0]\n[[load]]\ntype = "displacement"\nregion = "end"\nvalue = [0.0, "free"]\n'
    stepper = coupled_body(STEP, extra=held).stepper()
    gauge = Enrichment(comm, stepper)
    gauge.read(stepper)
    assert gauge.warnings() == []
    low = stepper.solution.mesh.points[stepper.solution.mesh.cells[:, 0], 0]
    stepper.patches.add(low == 8.0)
    stepper.patches.add(low == -12.0)  # these may: the most that were wanted at once is kept
    gauge.read(stepper)
    assert len(gauge.warnings()) == 1 and "10 vertices were wanted" in gauge.warnings()[0]


def test_looking_changes_nothing(coupled_body, shake, comm):
    seen, unseen = (shake(coupled_body(STEP).stepper(), 1e-2) for _ in range(2))
    gauge, guard = Enrichment(comm, seen), EnrichmentGuard(comm, [])
    guard.start(seen)
    for _ in range(3):
        gauge.read(seen)
        guard.observe(seen)
        seen.advance()
        unseen.advance()
    for key, (get, *_) in seen.state().items():
        assert np.array_equal(get(), unseen.state()[key][0]()), key


def test_growing_energy_stops_the_run(coupled_body, shake, comm):
    stepper = shake(coupled_body(STEP).stepper(), 1e-2)
    guard = EnrichmentGuard(comm, [])
    guard.start(stepper)
    stepper.advance()
    guard.observe(stepper)
    for factor, stops in ((1.03, False), (1.2, True)):  # of the velocities; kinetic energy is nearly all there is: 6 % and 44 % more
        velocities = stepper.local.subdomain.particles.velocity, stepper.solution.velocity
        kept = [each.copy() for each in velocities]
        for each in velocities:
            each *= factor
        if stops:
            with pytest.raises(RunError, match=r"the energy is .* J at step 1, t = 2.4 s, where .* J were put in: the coupling is unstable"):
                guard.finish(stepper)
        else:
            guard.observe(stepper)
        for each, before in zip(velocities, kept):
            each[:] = before
    stepper.solution.velocity[0, 0] = np.nan
    with pytest.raises(RunError, match="the energy is nan"):
        guard.observe(stepper)


def test_work_that_is_put_in_is_no_growth(coupled_body, comm):
    """A body nearly at rest under a load: the energy grows to a multiple of that of the start, by what the load brings in."""
    stepper = coupled_body(STEP, extra='[[load]]\ntype = "force_density"\nregion = "all"\nvalue = [1e-3, -2e-3]\n').stepper()
    stepper.solution.velocity[:] = 1e-4
    guard = EnrichmentGuard(comm, [])
    guard.start(stepper)
    initial = stepper.ledger()["kinetic_energy"].sum()
    for _ in range(5):
        stepper.advance()
        guard.observe(stepper)
    assert stepper.ledger()["kinetic_energy"].sum() > 100 * initial > 0.0


def test_a_failed_solve_stops_the_run(coupled_body, comm):
    stepper = coupled_body(STEP).stepper()
    guard = EnrichmentGuard(comm, [])
    guard.start(stepper)
    stepper.scheme.mass.failure = "the KSP did not converge"
    with pytest.raises(RunError, match="by step 0, t = 0 s, the KSP did not converge"):
        guard.observe(stepper)
