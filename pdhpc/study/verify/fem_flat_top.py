"""Linear polynomials on a flat-top partition of unity: patch test, order, independence, motion."""
import numpy as np

from pdhpc.fem.basis import Hats
from pdhpc.fem.elasticity import Elasticity
from pdhpc.fem.evaluate import errors
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.moduli import isotropic
from pdhpc.fem.nodes import stars_of
from pdhpc.fem.vertex_matrix import VertexMatrix
from pdhpc.parallel.comm import largest, world
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.fem_dynamics import balance, fixed_bar, newmark_bar, quarter_period, totals
from pdhpc.study.verify.fem_problems import box_mesh, linear_field, solid, solve_with, waves


@case
def fem_flat_top():
    """Flat-top functions times linear polynomials: patch test, orders, and independence, which hats times them lack"""
    comm, checks = world(), []
    for counts in ((5, 4), (3, 2, 4)):
        mesh = box_mesh(comm, counts)
        body, exact = solid(mesh, basis=FlatTop(mesh.kind)), linear_field(len(counts))
        problem = solve_with(body, exact)
        found = errors(body, problem.nodes.local(problem.nodes.displacement), exact.displacement, exact.gradient)
        checks.append(at_most(f"{mesh.kind}: uniform strain, error of displacement and gradient", max(found), 1e-10, "patch test"))
    found = []
    for n in (16, 32, 64):
        mesh = box_mesh(comm, (n, n))
        body = solid(mesh, basis=FlatTop(mesh.kind))
        exact = waves(body.tensors[0])
        problem = solve_with(body, exact)
        found.append(errors(body, problem.nodes.local(problem.nodes.displacement), exact.displacement, exact.gradient))
    orders = np.log2(np.array(found[:-1]) / found[1:])[-1]
    checks.append(Check("order in L2", orders[0], 2.0, 0.1, "manufactured solution", relative=False))
    checks.append(Check("order in H1", orders[1], 1.0, 0.05, "manufactured solution", relative=False))
    return checks + _independence()


class _HatsTimesLinears(FlatTop):
    """The dependent functions: hats in the place of phi."""

    def __init__(self, kind):
        super().__init__(kind)
        self.flat = 0.0


def scaled_spectrum(basis, counts):
    """Return the eigenvalues of the mass matrix of a body on this process alone, its diagonal scaled to 1, ascending."""
    from mpi4py import MPI

    mesh = box_mesh(MPI.COMM_SELF, counts)
    body = Elasticity(mesh, isotropic(1.0, 0.3, "plane_stress"), 1.0, basis=basis)
    mass = VertexMatrix(mesh, stars_of(mesh), body.width, (1.0, body.mass()))
    n = len(mesh.points)
    whole = np.zeros((n, body.width, n, body.width))
    whole[np.repeat(np.arange(n), np.diff(mass.row_start)), :, mass.column, :] = mass.value
    whole = whole.reshape(n * body.width, -1)
    root = 1.0 / np.sqrt(np.diag(whole))
    return np.linalg.eigvalsh(root[:, None] * whole * root)


def _independence():
    checks = []
    for counts in ((4, 4), (8, 8)):
        flat = scaled_spectrum(FlatTop("quad"), counts)
        checks.append(Check(f"condition of the scaled mass matrix of {counts[0]} x {counts[1]} cells: {flat[-1] / flat[0]:.1f}, below 100",
                            float(flat[-1] / flat[0] < 100), 1.0, 0.0, "flat tops"))
    hats = scaled_spectrum(_HatsTimesLinears("quad"), (4, 4))
    checks.append(Check(f"control: {int((hats < 1e-12 * hats[-1]).sum())} of {len(hats)} hats times linear polynomials depend on the others",
                        float(hats[0] < 1e-12 * hats[-1]), 1.0, 0.0, "x of hats is their sum of x_i"))
    return checks


@case
def fem_flat_top_motion():
    """Newmark's method on a flat-top partition of unity: period of a bar, energy"""
    comm = world()
    found = {}
    for name, basis in (("flat top", FlatTop("quad")), ("hats", Hats("quad"))):
        stepper, shape, x = fixed_bar(comm, newmark_bar, basis)
        first = totals(comm, stepper)
        found[name] = quarter_period(comm, stepper, shape, x)
        found[f"{name}, energy"] = balance(comm, stepper, first) / first["strain_energy"]
    lengthened = 1.0 + (0.5 * np.pi * 0.04) ** 2 / 12
    return [
        Check("quarter of the bar's period, s", found["flat top"], lengthened, 1e-3, "L / c"),
        at_most("energy balance, relative", largest(comm, found["flat top, energy"]), 1e-7, "average acceleration"),
        Check("quarter period against hats, s", found["flat top"], found["hats"], 1e-3, "same body"),
    ]
