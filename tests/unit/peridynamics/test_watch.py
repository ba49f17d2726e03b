import numpy as np
import pytest

from pdhpc.peridynamics.watch import Watch
from pdhpc.warm_up import block


def itself(values):
    return values


def watched(agree=itself, skin=2e-4, dt=1e-6, distance=None, cells=4):
    particles = block(2, cells, 2.0)[0].particles
    return particles, Watch(particles, skin, dt, agree, distance)


def run(particles, watch, dt, steps, velocity):
    """Let one particle fly; return (steps at which the list was made anew, the farthest that it had flown since the last time when an old one was used)."""
    slot, made, last, farthest = particles.slots[5], [], 0.0, 0.0
    for step in range(steps):
        particles.velocity[slot, 0] = velocity(step)
        if watch.due():
            made.append(step)
            last = particles.displacement[slot, 0]
        farthest = max(farthest, particles.displacement[slot, 0] - last)
        particles.displacement[slot, 0] += dt * velocity(step)
    return made, farthest


def test_the_list_is_made_before_half_the_skin_is_passed():
    particles, watch = watched()
    made, farthest = run(particles, watch, 1e-6, 1000, lambda step: 3.0 if step < 400 else 5.5)  # 3e-6 m a step of 1e-4 m
    assert made[0] == 0 and 20 <= len(made) <= 60
    assert 0.9e-4 < farthest <= 1e-4 and watch.overrun <= 1.0
    gaps = np.diff(made)
    assert gaps.max() > 20, "it is used for most of the way that it allows"


def test_a_body_at_rest_keeps_its_list_and_is_looked_at_now_and_then():
    calls = []
    particles, watch = watched(lambda values: calls.append(1) or values)
    assert run(particles, watch, 1e-6, 300, lambda step: 0.1)[0] == [0]
    assert 30 <= len(calls) <= 35, "every 10 steps"


def test_few_fast_particles_are_allowed_their_way():
    """At 3e-5 m a step half the skin of 1e-4 m is passed in four steps; of 144 particles one may go 1e-3 m, and the list is made every 34 steps."""
    particles, watch = watched(distance=1.4e-3, cells=12)
    made, farthest = run(particles, watch, 1e-6, 200, lambda step: 30.0)
    assert set(np.diff(made[1:])) == {34} and 0.9e-3 < farthest <= 1e-3 and watch.overrun <= 1.0
    assert np.sort(watch.allowance)[-2:] == pytest.approx([1e-4, 1e-3])
    slower, watch_it = watched(distance=1.4e-3, cells=12)
    run(slower, watch_it, 1e-6, 200, lambda step: 10.0)
    assert watch_it.allowance.max() == pytest.approx(6.4e-4), "64 steps, where that is nearer"
    particles.velocity[:, 0] = 200.0
    watch.restart()
    watch.due()
    assert watch.allowance == pytest.approx(np.full(144, 4e-4)), "where all are, as far as doubles the pairs, not more: two steps"
    particles.velocity[:, 0] = 1e4
    watch.restart()
    watch.due()
    assert watch.allowance == pytest.approx(np.full(144, 1e-4))


def test_a_burst_is_reported():
    particles, watch = watched()
    run(particles, watch, 1e-6, 200, lambda step: 0.1 if step < 95 else 60.0)
    assert watch.overrun > 1.0


def test_what_else_moves_counts_and_numbers_that_are_not_sane_do_not():
    particles, watch = watched()
    assert watch.due() and not watch.due() and watch.due(also=1.1e-4)
    assert not watch.due(also=0.9e-4, speed=90.0) and not watch.due(also=0.9e-4), "what is used now has not moved too far yet"
    particles.velocity[particles.slots[0], 0] = np.nan
    assert not any(watch.due() for _ in range(20))


def test_the_measure_is_agreed_on_and_it_starts_again():
    calls = []
    particles, watch = watched(lambda values: values * [1, 1, 1, 1, 2])
    particles.velocity[0] = 30.0
    for _ in range(100):
        watch.due(measure=lambda: calls.append(1) or 21.0)
        particles.displacement[0] += 3e-5
    assert 30 <= len(calls) <= 34, "every 3 steps, where the motion is looked at in each"
    while watch.largest == 0.0:
        watch.due(measure=lambda: 21.0)
    assert watch.largest == 42.0
    particles, watch = watched()
    assert watch.due() and not watch.due()
    watch.restart()
    assert watch.due()
