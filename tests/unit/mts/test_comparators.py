import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.mts import FINE, shake


def displacement(comm, method, m, share=0.4, steps=60, cells=(24, 16)):
    """Displacements by id after the same time, and the stepper."""
    text = plate(cells, kinematics="finite", extra=FINE.format(radius=4.0, m=m))
    dt = share * (m if method != "single" else 1) / 4
    problem = build(parse_scene(text, "scene", [f"time.method={method}", f"time.dt={dt}", "time.end=1e3"]), comm)
    shake(problem, 1e-3)
    stepper = problem.stepper()
    for _ in range(steps // (m if method != "single" else 1)):
        stepper.advance()
    stepper.view.prepare()
    return stepper.view.field("displacement")[np.argsort(stepper.view.ids)], stepper


@pytest.mark.parametrize("method", ("subcycling", "micro", "mts"))
def test_one_step_ratio_of_1_is_the_undivided_run(comm, method):
    expected, _ = displacement(comm, "single", 1)
    found, stepper = displacement(comm, method, 1)
    assert found == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
    assert stepper.view.n == 24 * 16 and stepper.view.directed_bonds() > 0 and stepper.broken == 0


@pytest.mark.parametrize("method", ("subcycling", "micro"))
def test_errors_shrink_with_the_step_ratio_of_the_comparators(comm, method):
    expected, _ = displacement(comm, "single", 1)
    errors = [np.linalg.norm(displacement(comm, method, m)[0] - expected) / np.linalg.norm(expected) for m in (4, 2)]
    assert 0 < errors[1] < errors[0] < 0.2


def test_subcycling_evaluates_each_region_for_itself_only(comm):
    _, stepper = displacement(comm, "subcycling", 4)
    spent = stepper.bond_evaluations
    whole = stepper.view.directed_bonds()
    fine = stepper.fine.subdomain.bonds.n_directed
    assert spent["coarse"] == (whole - fine) * 16 and spent["fine"] == fine * 61, "once at the start, and every step"
    assert {"coarse/displacement", "fine/velocity", "step"} <= set(stepper.state())
    energies = {name: values.sum() for name, values in stepper.ledger().items()}
    assert energies["kinetic_energy"] + energies["strain_energy"] == pytest.approx(0.5 * 1e-6 * 2 / 3 * 24 * 16, rel=0.1)
