import numpy as np

from pdhpc.peridynamics.watch import Watch
from pdhpc.warm_up import block


def itself(values):
    return values


def watched(agree=itself, skin=2e-4, dt=1e-6):
    particles = block(2, 4, 2.0)[0].particles
    return particles, Watch(particles, skin, dt, agree)


def run(particles, watch, dt, steps, velocity):
    """Let one particle fly; return (steps at which the list was made anew, distance that it had then flown since the last time)."""
    slot, made, last = particles.slots[5], [], 0.0
    for step in range(steps):
        particles.velocity[slot, 0] = velocity(step)
        if watch.due():
            made.append((step, particles.displacement[slot, 0] - last))
            last = particles.displacement[slot, 0]
        particles.displacement[slot, 0] += dt * velocity(step)
    return made


def test_the_list_is_made_before_half_the_skin_is_passed():
    particles, watch = watched()
    made = run(particles, watch, 1e-6, 1000, lambda step: 3.0 if step < 400 else 5.5)  # 3e-6 m a step of 1e-4 m
    assert made[0] == (0, 0.0) and 20 <= len(made) <= 60
    assert max(flown for _, flown in made) <= 1e-4 and watch.overrun <= 1.0
    gaps = np.diff([step for step, _ in made])
    assert gaps.max() > 20, "it is used for most of the way that it allows"


def test_a_body_at_rest_keeps_its_list_and_is_looked_at_now_and_then():
    calls = []
    particles, watch = watched(lambda values: calls.append(1) or values)
    assert len(run(particles, watch, 1e-6, 300, lambda step: 0.1)) == 1
    assert 30 <= len(calls) <= 35, "every 10 steps"


def test_a_burst_is_reported():
    particles, watch = watched()
    run(particles, watch, 1e-6, 200, lambda step: 0.1 if step < 95 else 60.0)
    assert watch.overrun > 1.0


def test_what_else_moves_counts_and_numbers_that_are_not_sane_do_not():
    particles, watch = watched()
    assert watch.due() and not watch.due() and watch.due(also=1.1e-4)
    assert not watch.due(speed=49.0) and watch.due(speed=51.0), "2 v dt > skin/2"
    particles.velocity[particles.slots[0], 0] = np.nan
    assert not any(watch.due() for _ in range(20))


def test_the_measure_is_agreed_on_and_it_starts_again():
    particles, watch = watched(lambda values: values + 1.0)
    watch.due(measure=lambda: 41.0)
    assert watch.largest == 42.0
    particles, watch = watched()
    assert watch.due() and not watch.due()
    watch.restart()
    assert watch.due()
