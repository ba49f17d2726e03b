"""Nodal fields on the mesh: forces are the slopes of energies, masses add up, prescribed motion and loads are accounted for."""
import numpy as np
import pytest

from pdhpc.gfem.mesh_solution import take_velocity

HELD = """
[[region]]
name = "left"
shape = "box"
lower = [-12.5, -8.0]
upper = [-11.5, 8.0]
[[load]]
type = "velocity"
region = "left"
value = [0.5, "free"]
time = { function = "ramp", start = 0.0, end = 4.0 }
"""
PULLED = """
[[load]]
type = "force_density"
region = "all"
value = [0.0, -2.0]
"""


def test_forces_are_the_slopes_of_energies(coupled_body):
    """The energy is quadratic: a central difference is exact, at vertices of plain cells, of the ramp and of the patches; whole cells store nothing."""
    stepper = coupled_body().stepper()
    solution, mesh = stepper.solution, stepper.solution.mesh
    solution.displacement[:] = np.random.default_rng(1).uniform(-1, 1, mesh.points.shape)
    solution.evaluate(0.0)
    force, energies = solution.force.copy(), solution.strain_energies()
    assert len(energies) == (~stepper.patches.whole).sum() < 24 and np.all(energies > 0.0)
    assert np.abs(force.sum(axis=0)).max() < 1e-12, "elements move nothing as a whole"
    for vertex in range(0, len(mesh.points), 3):
        ends = []
        for step in (0.5, -1.0):
            solution.displacement[vertex, 1] += step
            ends.append(solution.strain_energies().sum())
        solution.displacement[vertex, 1] += 0.5
        assert force[vertex, 1] == pytest.approx(ends[1] - ends[0], abs=1e-11)


def test_masses_outside_add_up(coupled_body):
    stepper = coupled_body().stepper()
    solution, mesh, patches = stepper.solution, stepper.solution.mesh, stepper.patches
    assert solution.outside_mass.sum() == pytest.approx(16.0 * (~patches.enriched).sum()) and 0 < patches.enriched.sum() < 24
    inner = ~np.isin(np.arange(len(mesh.points)), mesh.cells[~patches.enriched])
    assert np.all(solution.outside_mass[inner] == 0.0) and inner.sum() > 0 and np.all(solution.outside_mass[~inner] > 0.0)
    solution.velocity[:] = (3.0, 4.0)
    assert solution.kinetic_energies().sum() == pytest.approx(0.5 * 25.0 * solution.outside_mass.sum())


def test_loads_outside_act_and_work(coupled_body):
    stepper = coupled_body(extra=PULLED).stepper()
    solution, patches = stepper.solution, stepper.patches
    solution.displacement[:] = 0.0
    solution.evaluate(0.0)
    assert solution.force.sum(axis=0) == pytest.approx((0.0, -2.0 * 16.0 * (~patches.enriched).sum())), "-2 on each unit of area"
    solution.change[:] = (7.0, 0.3)
    solution.account(1.0, 0.5)
    assert solution.external_work().sum() == pytest.approx(-0.3 * 2.0 * 16.0 * (~patches.enriched).sum())
    getter, setter, _ = solution.work_state()["work/mesh_loads"]
    kept = getter().copy()
    solution.account(1.0, 0.5)
    setter(kept)
    assert solution.external_work().sum() == pytest.approx(kept.sum())


def test_prescribed_velocities_are_met_and_accounted_for(coupled_body):
    """The work of the hold is the kinetic energy it gives, less what the other forces do: here (3 + 5)/2 . du over the step."""
    parts = coupled_body(tip=None, extra=HELD).coupled_parts
    solution, dt = parts.solution, 0.5
    left = parts.mesh.points[:, 0] == -12.0
    solution.velocity[:] = 0.1
    solution.begin()
    assert np.all(solution.velocity[left, 0] == 0.0) and np.all(solution.velocity[left, 1] == 0.1), "a ramp starts at 0"
    solution.change[:] = 9.0
    solution.steer(1.0, dt)
    moved = dt * 0.5 * 1.25 / 4.0  # the velocity in the middle of the step
    assert solution.change[left, 0] == pytest.approx(moved) and np.all(solution.change[~left] == 9.0) and np.all(solution.change[left, 1] == 9.0)
    solution.right[:] = 0.5 * dt * (3.0 + 5.0)
    solution.account_motions(dt)
    solution.settle_motions(1.5)
    assert solution.change[left, 0] == pytest.approx(0.5 * 1.5 / 4.0)
    solution.velocity[left, 0] = solution.change[left, 0]
    kinetic = 0.5 * solution.outside_mass[left].sum() * (0.5 * 1.5 / 4.0) ** 2
    assert solution.external_work().sum() == pytest.approx(kinetic - left.sum() * 4.0 * moved)
    assert set(solution.work_state()) == {"work/mesh_loads", "work/motion_0", "initial_kinetic/0"}


def test_velocities_are_taken_where_they_are_standard():
    velocity, acceleration, previous = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0, 6.0], [7.0, 8.0]]), np.zeros((2, 2))
    change = np.array([[1.5, 1.0], [9.0, 9.0]])
    take_velocity(np.array([True, False]), 0.5, change, velocity, acceleration, previous)
    assert velocity.tolist() == [[1.5, 1.0], [0.0, 0.0]] and acceleration.tolist() == [[1.0, -2.0], [0.0, 0.0]]
    assert previous.tolist() == [[5.0, 6.0], [7.0, 8.0]]


def test_before_the_first_step_there_was_no_other_acceleration(coupled_body):
    solution = coupled_body(tip=None).coupled_parts.solution
    everywhere = np.ones(len(solution.mesh.points), bool)
    for change, acceleration, previous in ((1.0, 2.0, 2.0), (4.0, 6.0, 2.0)):
        solution.change[:] = change
        solution.accept_velocity(everywhere, 0.5)
        assert np.all(solution.acceleration == acceleration) and np.all(solution.previous_acceleration == previous)
