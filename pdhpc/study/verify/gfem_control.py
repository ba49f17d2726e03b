"""A coupling that must fail: a blend without a ramp."""
import numpy as np


def blend_by_a_step(stepper):
    """Let alpha jump from 1 in cells all of whose vertices are in J to 0 in all others, for particles and elements. Collective."""
    local, solution = stepper.local, stepper.solution
    set_alpha = local._set_alpha

    def without_ramp(cells, weight):
        set_alpha(cells, weight)
        local.alpha[:] = local.alpha >= 1.0

    local._set_alpha = without_ramp
    local._weight = np.zeros_like(local._weight)  # all of it has changed
    stepper.follow()
    whole = stepper.patches.whole[: solution.mesh.n_owned_cells]
    solution._kind = solution.material.ramped_kind(np.zeros(len(solution.mesh.points)))[0]
    solution._acting = np.flatnonzero(~whole).astype(np.int32)
    solution.evaluate(stepper.time)
