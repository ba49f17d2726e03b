"""Couplings that must fail: "pinned" without the standard functions inside the patches, and a blend without a ramp."""
import numpy as np

from pdhpc.gfem.ramp_mass import RampMass


class OuterMass(RampMass):
    """The mass of the functions of vertices outside J; those of others do not act."""

    def __init__(self, patches):
        """Local."""
        super().__init__(patches.mesh)
        self._patches = patches

    def follow(self, local, outside_mass):
        """As RampMass. Collective over neighbours."""
        super().follow(local, outside_mass)
        self.lumped[self._patches.chosen] = 0.0
        self.acting = self.lumped > 0.0


def make_outer(problem):
    """Return a CoupledStep of a CoupledProblem by u^h = alpha U + (1 - alpha) sum_{i not in J} phi_i a_i. Collective."""
    stepper = problem.stepper()
    stepper.scheme.mass = OuterMass(stepper.patches)
    return stepper


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
