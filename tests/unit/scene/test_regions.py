import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate

FINE = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = {radius}\n'


def made(comm, *overrides, radius=3.0, kinematics="linear"):
    return build(parse_scene(plate((24, 16), kinematics=kinematics, extra=FINE.format(radius=radius)), "scene", ["time.end=200.0", *overrides]), comm)


def test_step_ratio_auto_meets_the_error(comm):
    """m = ceil(pi c dT/(delta sqrt(24 error))), c = sqrt(9 E/(8 rho))."""
    for error in (1e-2, 1e-3, 1e-4):
        problem = made(comm, "time.dt=1.0", f"time.error={error}")
        assert problem.m == int(np.ceil(np.pi * np.sqrt(9 / 8) / 3.0 / np.sqrt(24 * error)))
        assert problem.dt == 1.0


def test_finite_motions_get_a_smaller_step_unless_told(comm):
    linear, finite, told = made(comm), made(comm, kinematics="finite"), made(comm, "time.safety=0.9", kinematics="finite")
    assert finite.dt == pytest.approx(0.65 / 0.9 * linear.dt, rel=0.02) and finite.dt < 0.8 * told.dt
    assert any("above 0.65" in warning for warning in told.warnings) and not finite.warnings


@pytest.mark.parametrize("overrides, words", [
    (["fine.center=[11.0, 7.0]", "fine.radius=40.0"], "with no particle beyond its overlap"),
    (["fine.center=[11.9, 7.9]", "fine.radius=0.2"], "with no particle in it"),
    (["fine.overlap=0.5"], "fine: overlap = 0.5; allowed is 1 to 100 horizons"),
    (["time.method=single", "fine.interface=kick"], 'fine: interface = "kick" with time.method = "single"'),
    (["fine.center=[60.0, 0.0]"], "outside every body"),
    (["time.error=1e-9"], "which comes to"),
])
def test_what_cannot_be_is_said(comm, overrides, words):
    with pytest.raises(SceneError, match=words):
        made(comm, *overrides)


def test_what_nothing_uses_is_said(comm):
    assert any("[fine] is not used" in warning for warning in made(comm, "time.method=single").warnings)
    assert any("time.error is not used" in warning for warning in made(comm, "fine.step_ratio=3", "time.error=1e-3").warnings)


def test_the_interface_is_chosen_by_the_fine_regions_step(comm):
    regions = made(comm, "fine.step_ratio=4").regions
    critical = regions.sharp_critical_step()
    assert regions.parts[1].critical_dt < critical and regions.interface(0.99 * critical) == "polynomial" and regions.interface(1.01 * critical) == "exact"


@pytest.mark.parametrize("method, name", [("mts", "MultiTimeStep"), ("subcycling", "Subcycling"), ("micro", "MicroContinuity"), ("single", "VelocityVerlet")])
def test_methods(comm, method, name):
    stepper = made(comm, "fine.step_ratio=2", f"time.method={method}").stepper()
    assert type(stepper).__name__ == name and stepper.view.n == 24 * 16


STIFF = """
[[material]]
name = "stiff"
density = 1.0
youngs_modulus = 16.0
[[body]]
name = "right"
material = "stiff"
shape = "box"
lower = [12.0, -8.0]
upper = [24.0, 8.0]
[fine]
shape = "box"
lower = [7.0, -9.0]
upper = [25.0, 9.0]
"""


def stiff(comm, *overrides):
    return build(parse_scene(plate((24, 16), extra=STIFF), "scene", ["time.end=200.0", *overrides]), comm)


def test_a_stiffer_fine_region_asks_for_more_steps(comm):
    """Four times the wave speed: a quarter of the critical step, whatever the rest may take."""
    with pytest.raises(SceneError, match=r'fine: step_ratio = 2, a step of 0.6\d+ s; allowed is "auto" or at least 4: the critical step of the region is 0.3'):
        stiff(comm, "fine.step_ratio=2", "time.dt=1.3")
    problem = stiff(comm, "time.error=0.9")
    assert problem.m == 4 and problem.dt / 4 <= problem.critical_dt and problem.regions.interface(problem.dt) == "exact"
    with pytest.raises(SceneError, match=r'fine: interface = "polynomial" with a macro step of 1.3 s; allowed is "auto", "exact" or "kick"'):
        stiff(comm, "fine.step_ratio=5", "time.dt=1.3", "fine.interface=polynomial")
    stepper = problem.stepper()
    first = stepper.conserved_quantity().sum()
    assert first == 0.0


def test_e_star_is_conserved_across_a_stiffer_region(comm):
    problem = stiff(comm, "fine.step_ratio=5", "time.dt=1.2", "time.end=300.0")
    for part in problem.parts:
        particles = part.subdomain.particles
        particles.put(particles.velocity, 1e-3 * np.sin(part.subdomain.places()))
    stepper = problem.stepper()
    stepper.operator = problem.regions.operator(stepper.interface, problem.dt, "exact", tolerance=1e-12)
    first = stepper.conserved_quantity().sum()
    for _ in range(250):
        stepper.advance()
    assert stepper.conserved_quantity().sum() == pytest.approx(first, rel=1e-10) and first > 0
