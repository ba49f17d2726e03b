"""Two regions at their own steps on all ranks against the same run on one, and every verification of the method on all ranks together."""
import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
import pdhpc.study.verify.mts_plate  # noqa: F401  (registers its cases)
from pdhpc.study.verify.case import CASES, plate
from pdhpc.study.verify.mts import field_by_id, shake

FINE = '[fine]\nshape = "disk"\ncenter = [3.0, 1.0]\nradius = 7.0\nstep_ratio = 4\n'
PULL = '[[initial]]\nregion = "all"\nvelocity_gradient = [[0.0, 0.0], [0.0, 1.5e-3]]\n'
LPS = 'model = "lps"\npoissons_ratio = 0.2\n'


def moved(comm, text, overrides):
    """Return ({field: values by id}, broken bonds) after 60 macro steps."""
    problem = build(parse_scene(text, "scene", overrides), comm)
    shake(problem, 4e-3)
    stepper = problem.stepper()
    for _ in range(60):
        stepper.advance()
    stepper.view.prepare()
    fields = {name: field_by_id(stepper.view, stepper.view.field(name), comm) for name in ("displacement", "velocity", "damage", "stress")}
    return fields, comm.allreduce(stepper.broken)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", ("lattice", "cloud"))
@pytest.mark.parametrize("kinematics, model, interface, dt", [
    ("finite", "", "polynomial", 0.8), ("linear", "", "exact", 0.8), ("finite", "", "kick", 0.8), ("finite", LPS, "polynomial", 0.4),
])
def test_any_number_of_ranks_gives_the_same(comm, path, kinematics, model, interface, dt):
    from mpi4py import MPI

    text = plate((50, 36), kinematics=kinematics, extra=FINE + PULL, material=model + ("critical_stretch = 0.02" if kinematics == "finite" else ""))
    overrides = [f"particles.path={path}", f"time.dt={dt}", "time.end=1e3", f"fine.interface={interface}"]
    found, broken = moved(comm, text, overrides)
    expected, broken_alone = moved(MPI.COMM_SELF, text, overrides)
    assert broken == broken_alone and (broken > 50) == (kinematics == "finite")
    for name, values in found.items():
        scale = np.abs(expected[name]).max()
        assert np.abs(values - expected[name]).max() <= (1e-10 * scale if interface == "exact" else 0.0), "only CG adds up over ranks"


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", ("lattice", "cloud"))
@pytest.mark.parametrize("m, radius", [(2, 20.0), (10, 30.0), (20, 60.0)])
def test_work_differs_by_at_most_5_per_cent(comm, path, m, radius):
    fine = f'[fine]\nshape = "disk"\ncenter = [20.0, 10.0]\nradius = {radius}\nstep_ratio = {m}\n'
    problem = build(parse_scene(plate((300, 200), extra=fine), "scene", [f"particles.path={path}", "time.dt=0.8"]), comm)
    works = comm.allgather(sum(steps * part.subdomain.bonds.n_directed for part, steps in zip(problem.parts, (1, m))))
    assert max(works) <= 1.05 * np.mean(works), works
    both = comm.allreduce(int(all(part.subdomain.particles.n_owned for part in problem.parts)))
    assert both <= 1, "at most one rank has parts of both regions where they border"


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("method", ("subcycling", "micro"))
def test_comparators_too(comm, method):
    from mpi4py import MPI

    text, overrides = plate((40, 30), kinematics="finite", extra=FINE), [f"time.method={method}", "time.dt=0.8", "time.end=1e3"]
    found, expected = moved(comm, text, overrides)[0], moved(MPI.COMM_SELF, text, overrides)[0]
    for name, values in found.items():
        assert np.array_equal(values, expected[name]), name


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("name", ("mts_split", "mts_one_step_ratio", "mts_operators", "mts_cost", "mts_order"))
def test_verification_on_all_ranks(comm, name):
    failures = [f"{check.what}: {check.measured!r}, expected {check.expected!r}" for check in CASES[name].function() if not check.passed]
    assert not failures, failures
