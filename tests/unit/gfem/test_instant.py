import numpy as np


def test_stable_below_its_critical_step_and_not_above(pulled_plate, comm):
    """The mean force lets sub-steps be invisible to the global step; the instant one does not: at a step that "galerkin" takes well it blows up."""
    largest = {}
    for name, dt, k in (("galerkin", 3.0, 4), ("instant", 3.0, 4), ("instant", 1.0, 1)):
        parts, stepper = pulled_plate(comm, name, steps=(dt, k))
        parts.local.law.break_at[...] = np.inf
        critical = []
        for _ in range(round(90 / dt)):
            stepper.advance()
            critical.append(getattr(stepper.scheme, "critical_dt", np.inf))
            if not np.abs(parts.solution.displacement).max() < 1e3:
                break
        largest[name, dt] = np.abs(parts.solution.displacement).max()
        if name == "instant":
            assert min(critical) < 3.0 and min(critical) > 1.0, "the particles' own critical step is 1.6"
    assert largest["instant", 1.0] < 1.1 * largest["galerkin", 3.0] and not largest["instant", 3.0] < 100 * largest["galerkin", 3.0]


def test_too_large_a_step_is_a_failure_with_its_number(pulled_plate, comm):
    _, stepper = pulled_plate(comm, "instant", steps=(3.0, 4))
    stepper.scheme.refuses = True
    for _ in range(3):
        stepper.advance()
    assert "critical step is 2." in stepper.failure and "time.dt 3 s" in stepper.failure
