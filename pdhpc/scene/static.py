"""Scene -> objects for bodies that stand still: load steps and the solvers of equilibria."""
from functools import partial

import numpy as np

from pdhpc.observers.equilibrium import EquilibriumGauge
from pdhpc.parallel.comm import Sums
from pdhpc.parallel.linear_solver import Defaults, LinearSolver
from pdhpc.peridynamics.equilibrium import LoadPath
from pdhpc.peridynamics.newton import Newton
from pdhpc.peridynamics.relaxation import Relaxation
from pdhpc.scene.pieces import check_supports
from pdhpc.scene.problem import Problem
from pdhpc.scene.schema import STANDING

_KSP_ITERATIONS = 10_000


class StaticProblem(Problem):
    """Everything one rank needs to bring a scene of particles from one equilibrium to the next."""

    def coupling(self, stepper, comm):
        """Return the gauge of the equilibria. Local."""
        return EquilibriumGauge(comm)

    def coupled(self, stepper, comm, coupling):
        """Return None: nothing is coupled. Local."""
        return None

    def work(self, stepper, comm, seconds):
        """Return what run.json says of the work done in `seconds` of stepping and of the equilibria found. Collective."""
        found = super().work(stepper, comm, seconds)
        del found["particle_steps_per_second_and_core"]  # a load step takes as many evaluations as it needs
        return {**found, "equilibrium": {"tolerance": stepper.path.tolerance, "reference_force": stepper.reference, **stepper.totals}}


def static_problem(scene, body, part, comm):
    """Return the StaticProblem of a furnished part. Collective.

    Raises
    ------
    SceneError, on every rank: supports that leave a rigid motion of a piece of the body free.
    """
    check_supports(scene, body, part, comm)
    path = load_path(scene, body)
    prefer = "cg" if scene.particles.kinematics == "linear" else "minres"  # tangents of stretched and pressed bonds may be indefinite

    def make_stepper(dt):
        arguments = part.subdomain, body.law, part.conditions, part.exchange.bind, Sums(comm), path
        if scene.method == "relaxation":
            return Relaxation(*arguments)
        stepper = Newton(*arguments)
        stepper.make_solver(partial(LinearSolver, comm, "static_", Defaults(prefer, iterations=_KSP_ITERATIONS)))
        return stepper

    return StaticProblem(scene, body, [part], np.inf, path.dt, 1, scene.load_steps, _warnings(scene), make_stepper)


def load_path(scene, body):
    """Return the LoadPath of a scene and its Body. Local."""
    table, lower_upper = scene.static, [each.bounds() for each in body.lattices]
    longest = max(high - low for low, high in zip(np.min([lower for lower, _ in lower_upper], axis=0), np.max([upper for _, upper in lower_upper], axis=0)))
    most = table.iterations or STANDING[scene.method]
    one_by_one = table.breaking == "most_strained"
    spacing = body.spacing
    return LoadPath(scene.time.end / scene.load_steps, table.tolerance, most, one_by_one, table.equilibria, spacing, max(1, round(longest / spacing)))


def _warnings(scene):
    """Return what the user should know of the load steps."""
    dt, times = scene.time.end / scene.load_steps, scene.output.times or []
    moved = [time for time in times if abs(time / dt - round(time / dt)) > 1e-6]
    return [f"output.times = {moved[0]:g} s is no load step ({dt:g} s each): frames are those of the nearest ones"] if moved else []

