"""Couplings that must fail: "pinned" without the standard functions inside the patches, and a blend without a ramp."""
import numpy as np

from pdhpc.gfem.coupled_step import CoupledStep
from pdhpc.gfem.patch_mass import PatchMass
from pdhpc.gfem.pinned import Pinned
from pdhpc.kernels.simd import LANES


class Outer(Pinned):
    """u^h = alpha U + sum_{i not in J} phi_i a_i: on the ramp the state is what these functions carry, and nothing beside."""

    def _find_displacement(self, position, time):
        """As Pinned, with alpha U + sum_{i not in J} phi_i d_i in the place of u^n + alpha (U - u^n). Collective."""
        blended, mesh = self.local.blended, self.solution.mesh
        lane = np.flatnonzero(blended.inside & (blended.alpha < 1.0))
        row, place = np.divmod(lane, LANES)
        slots, alpha, before = blended.rows[row] + place, blended.alpha[lane, None], blended.before[row, :, place]
        outer = np.where(self._standard[:, None], self.solution.displacement, 0.0)
        carried = np.einsum("na,nad->nd", blended.shape[lane], outer[mesh.cells[blended.cell[lane]]])
        position[slots] = before + (alpha * position[slots] + carried - before) / alpha
        super()._find_displacement(position, time)


class OuterMass(PatchMass):
    """M^ of the functions of vertices outside J; the coefficients of the others are 0."""

    def follow(self, patches, outside_mass):
        """As PatchMass. Collective."""
        whole, corners = self._mass, self.mesh.cells.shape[1]
        inside = patches.chosen[self.mesh.cells]
        joined = (inside[:, :, None] | inside[:, None, :]) & ~np.eye(corners, dtype=bool)
        self._mass = np.where(joined.reshape(whole.shape), 0.0, whole)
        super().follow(patches, outside_mass)
        self._mass, self._kept = whole, ~patches.chosen[self.inner, None]

    def solve(self, right, change):
        """As PatchMass. Collective."""
        right[self.inner] *= self._kept
        super().solve(right, change)


def make_outer(problem):
    """Return a CoupledStep of a CoupledProblem by the scheme Outer. Collective."""
    parts = problem.coupled_parts
    problem.stepper()  # chooses the patches
    mass = OuterMass(parts.comm, parts.mesh, parts.material)
    return CoupledStep(parts.comm, parts.patches, parts.local, parts.solution, Outer(parts.solution, parts.local, mass, problem.dt, problem.k), 0.6)


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
