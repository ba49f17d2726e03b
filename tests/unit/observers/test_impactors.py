import numpy as np

from pdhpc.observers.impactors import ImpactorGauge
from pdhpc.scene.gauges import make_gauges
from pdhpc.study.verify.case import plate, problem_of

FLOOR = '[[impactor]]\nname = "floor"\nshape = "plane"\npoint = [0.0, -2.0]\nnormal = [0.0, 3.0]\nvelocity = [0.0, 0.01]\n'
BALL = '[[impactor]]\nname = "ball"\nshape = "cylinder"\ncenter = [0.0, 12.0]\nradius = 2.0\nvelocity = [0.0, -0.02]\nmass = 3.0\n'


def pressed():
    """Return the problem of a plate that touches the floor, set down 0.2 deeper once it is built: scenes may not start so."""
    problem = problem_of(plate((6, 4), kinematics="finite", extra=FLOOR + BALL))
    problem.subdomain.particles.displacement[:, 1] -= 0.2
    return problem


def test_columns_say_where_how_fast_and_with_what_force(comm):
    problem = pressed()
    stepper = problem.stepper()
    gauge = ImpactorGauge(comm, "floor", 2)
    assert gauge.columns == ("floor.position_x [m]", "floor.position_y [m]", "floor.velocity_x [m/s]", "floor.velocity_y [m/s]", "floor.force_x [N]", "floor.force_y [N]")
    values = gauge.read(stepper)
    # the lowest row of six particles, centres at -1.7 and radius 0.5, is 0.2 deep at E/h^2 = V = 1
    assert np.allclose(values, [0.0, -2.0, 0.0, 0.01, 0.0, -6 * 0.2])
    stepper.advance()
    assert np.isclose(gauge.read(stepper)[1], -2.0 + 0.01 * stepper.dt)
    assert ImpactorGauge(comm, "ball", 2).read(stepper)[3] == -0.02


def test_a_scene_with_impactors_has_their_gauges_and_energies(comm):
    problem = pressed()
    stepper = problem.stepper()
    energies, gauges, _ = make_gauges(problem, stepper.view, comm)
    assert [gauge.name for gauge in gauges] == ["floor", "ball"]
    row = dict(zip(energies.columns, energies.read(stepper)))
    assert row["impactor_energy [J]"] == 0.5 * 3.0 * 0.02**2 and np.isclose(row["contact_energy [J]"], 6 * 0.5 * 0.2**2) and row["balance_error [J]"] == 0.0
    for _ in range(20):
        stepper.advance()
    later = dict(zip(energies.columns, energies.read(stepper)))
    assert abs(later["contact_energy [J]"] - row["contact_energy [J]"]) > 0.05, "of 0.12 J: the floor throws the body up"
    assert abs(later["balance_error [J]"]) < 0.01
