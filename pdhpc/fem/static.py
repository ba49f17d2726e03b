"""Static equilibrium: one linear solve a step."""
import time

from pdhpc.fem.implicit import Implicit, refreshed
from pdhpc.fem.vertex_matrix import ConstrainedSolver, VertexMatrix
from pdhpc.parallel.linear_solver import Defaults

DEFAULTS = Defaults("cg", 1e-12, 500, "gamg")


class Static(Implicit):
    """K u = F(t) with prescribed components, at t = dt, 2 dt, ...; the body is unloaded before the first step.

    Solved by the KSP "gfem_": conjugate gradients with algebraic multigrid that knows the rigid motions. Velocities are 0.
    """

    def __init__(self, body, nodes, conditions, dt=1.0, defaults=DEFAULTS):
        """Assemble the stiffness. Collective over the mesh's ranks.

        body : Elasticity. nodes : Nodes(mesh, False, body.width). conditions : NodalConditions that leave no rigid motion free. dt : s.
        """
        super().__init__(body, nodes, conditions, dt)
        started = time.perf_counter()
        self.stiffness = VertexMatrix(body.mesh, nodes.stars, body.width, (1.0, body.stiffness()))
        self._solver = ConstrainedSolver(self.stiffness, body.basis, self.fixed, "gfem_", defaults)
        self.seconds["assemble"] += time.perf_counter() - started

    def _advance(self, t):
        nodes = self.nodes
        before, loads = nodes.owned(nodes.displacement), self._loads(t)
        u = self._solve(self._solver, loads, self._targets(t))
        nodes.put(nodes.displacement, u)
        self._account(loads, self.stiffness.multiply(refreshed(nodes, nodes.displacement)), u - before)
