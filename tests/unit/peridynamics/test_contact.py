import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS

TWO = """
[[body]]
name = "other"
material = "solid"
shape = "box"
lower = [{x}, -3.0]
upper = [{end}, 3.0]
[[region]]
name = "other"
body = "other"
shape = "box"
lower = [-99.0, -99.0]
upper = [99.0, 99.0]
[[initial]]
region = "other"
velocity = {velocity}
{more}
[contact]
{contact}
"""


def two(path="cloud", contact="", velocity="[-0.3, 0.05]", more="", material="", x=9.0, model=""):
    text = TWO.format(x=x, end=x + 6.0, velocity=velocity, more=more, contact=contact)
    return problem_of(plate((10, 8), kinematics="finite", material=f"{material}\n{model}", extra=text), [f"particles.path={path}"])


def contact_of(stepper):
    return stepper.conditions.interactions[0]


@pytest.mark.parametrize("path", PATHS)
def test_forces_are_minus_the_gradient_of_the_energy(path):
    """Move one particle of pressed bodies: the energy of contact changes by minus the work of its force."""
    problem = two(path, more="displacement = [-3.9, 0.2]")
    particles = problem.subdomain.particles
    stepper = problem.stepper()
    contact, step = contact_of(stepper), 1e-6
    slot = particles.slots[int(np.argmax(np.linalg.norm(_forces(contact, particles), axis=1)))]
    row = int(np.flatnonzero(particles.slots == slot)[0])
    force = _forces(contact, particles)[row] * particles.volume[slot]
    energies = []
    for sign in (1, -1):
        particles.displacement[slot, 0] += sign * step
        particles.place()
        _forces(contact, particles)
        energies.append(contact.ledger()["contact_energy"].sum())
        particles.displacement[slot, 0] -= sign * step
    assert abs(force[0]) > 1e-3 and force[0] == pytest.approx(-(energies[0] - energies[1]) / (2 * step), rel=1e-6)


def _forces(contact, particles):
    """Return (n_owned, dim) contact force densities at the current positions."""
    force = np.zeros_like(particles.force_density)
    contact.add_to(force, 0.0, 0)
    return particles.owned(force).copy()


@pytest.mark.parametrize("path", PATHS)
def test_unloaded_bodies_feel_nothing(path):
    """Side by side, or with a gap smaller than the distance of contact: nothing repels in the unloaded state."""
    problem = two(path, x=5.0)
    stepper = problem.stepper()
    assert not _forces(contact_of(stepper), problem.subdomain.particles).any()


@pytest.mark.parametrize("path", PATHS)
def test_a_pair_repels_from_the_evaluation_in_which_its_bond_breaks(path, lose_bonds):
    problem = problem_of(plate((6, 6), kinematics="finite", material="critical_stretch = 0.5", extra="[contact]\n"), [f"particles.path={path}"])
    particles, stepper = problem.subdomain.particles, problem.stepper()
    contact = contact_of(stepper)
    particles.displacement[particles.slots[14], 0] = 0.3  # particle 14 nears its neighbour
    particles.place()
    assert not _forces(contact, particles).any(), "all bonds are intact"
    lose_bonds(problem.subdomain, 14)
    force = np.zeros_like(particles.force_density)
    contact.add_to(force, 0.0, 28)
    assert particles.owned(force)[14, 0] < 0 and np.count_nonzero(particles.owned(force)[:, 0]) == 1, "its end alone: the others still hold their bonds"


@pytest.mark.parametrize("friction", ["", "friction = 0.4\ndamping = 0.2"])
@pytest.mark.parametrize("path", PATHS)
def test_energy_balance_closes_as_the_square_of_the_step(path, friction):
    left = []
    for halving in (1, 2):
        problem = two(path, friction)
        problem.dt = 0.3 / halving
        stepper = problem.stepper()
        start, change, pressed = _total(stepper), 0.0, 0.0
        for _ in range(100 * halving):
            stepper.advance()
            change = max(change, abs(_total(stepper) / start - 1))
            pressed = max(pressed, stepper.ledger()["contact_energy"].sum())
        assert pressed > 1e-2
        left.append(change)
    assert left[0] < 5e-3 and left[1] < 0.4 * left[0]


def _total(stepper):
    ledger = {name: values.sum() for name, values in stepper.ledger().items()}
    return sum(ledger.values()) - 2 * ledger["external_work"]


def test_contact_has_a_clock_of_its_own(monkeypatch):
    """Of a step in which a second passes at every look at the clock, contact takes one second in each of its three parts, and none of them is integration."""
    from itertools import count

    from pdhpc.conditions import conditions
    from pdhpc.peridynamics import velocity_verlet

    stepper, seconds = two().stepper(), count()
    before = dict(stepper.seconds)
    for module in (conditions, velocity_verlet):
        monkeypatch.setattr(module.time, "perf_counter", lambda: float(next(seconds)))
    stepper.begin()
    stepper.finish()
    assert stepper.seconds["contact"] - before["contact"] == 3.0
    assert stepper.seconds["integrate"] - before["integrate"] == 5.0, "ten looks: begin 0 to 3, finish 4 to 9, less three"


def test_losses_only_grow():
    stepper = two(contact="friction = 0.4\ndamping = 0.3", velocity="[-0.3, 0.2]").stepper()
    losses = []
    for _ in range(60):
        stepper.advance()
        losses.append(stepper.ledger()["contact_loss"].sum())
    assert min(np.diff(losses)) > -1e-6 and losses[-1] > 0.05, "of 1.9 J per unit of width"


@pytest.mark.parametrize("model", ["", 'model = "lps"\npoissons_ratio = 0.2'])
@pytest.mark.parametrize("path", PATHS)
def test_a_run_goes_on_from_its_state_to_the_last_bit(path, model):
    """Set the state of a run in the middle of a collision in a new stepper: it goes on as the first one does."""
    def make():
        return two(path, "friction = 0.4\ndamping = 0.2", material="critical_stretch = 0.05", model=model).stepper()

    one, other = make(), make()
    for _ in range(30):
        one.advance()
    for key, (getter, *_) in one.state().items():
        value = getter()
        other.state()[key][1](np.array(value) if isinstance(value, np.ndarray) else value)
    other.subdomain.particles.place()
    other.internal.evaluate()
    other._add_loads()
    for _ in range(40):
        one.advance()
        other.advance()
    assert one.broken > 20 and one.ledger()["contact_loss"].sum() > 0
    for name in ("displacement", "velocity", "force_density"):
        assert np.array_equal(one.subdomain.particles.owned(getattr(one.subdomain.particles, name)), other.subdomain.particles.owned(getattr(other.subdomain.particles, name)))
    assert np.array_equal(one.ledger()["contact_loss"], other.ledger()["contact_loss"])


def test_what_the_run_should_know():
    stepper = two().stepper()
    contact = contact_of(stepper)
    stepper.advance()
    assert contact.warnings() == [] and contact.bytes_sent == 0
    contact.watch.overrun, contact.stable_dt = 1.5, 0.9 * stepper.dt
    words = contact.warnings()
    assert "moved 1.50 of half the skin, 0.15 m" in words[0] and "pairs may have been missed" in words[0] and "lowered the critical step" in words[1]


def test_a_step_that_contact_makes_too_large_is_noticed():
    """Bodies of a contact forty times as stiff as by default, pressed together at the step of the bonds alone."""
    problem = two(contact="stiffness = 60.0", velocity="[-0.3, 0.0]")
    problem.dt = 0.5
    stepper = problem.stepper()
    for _ in range(30):
        stepper.advance()
    assert "lowered the critical step" in contact_of(stepper).warnings()[0]
