"""Finite elements in equilibrium: patch tests, observed orders, a beam, the same bits on any number of ranks."""
import numpy as np

from pdhpc.conditions.time_functions import Constant
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.evaluate import cell_stresses, errors, nodal_stresses
from pdhpc.fem.internal_forces import InternalForces, make_sweep
from pdhpc.fem.loads import facets_where, nodal_load, traction_loads
from pdhpc.fem.moduli import PAIRS
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.static import Static
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.parallel.comm import largest, smallest, world
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, linear_field, solid, solve_with, waves

COUNTS = {"quad": (7, 6), "triangle": (7, 6), "hexahedron": (4, 3, 5), "tetra": (4, 3, 5)}


def worst(comm, values):
    """Return the largest |value| on any rank. Collective."""
    return largest(comm, float(np.abs(values).max(initial=0.0)))


@case
def fem_patch():
    """Uniform strain is exact on distorted meshes of all four kinds of cells"""
    comm, checks = world(), []
    for kind, counts in COUNTS.items():
        body = solid(general_mesh(comm, kind, counts, 0.2))
        exact, mesh = linear_field(len(counts)), body.mesh
        problem = solve_with(body, exact)
        u = problem.nodes.local(problem.nodes.displacement)
        checks.append(at_most(f"{kind}: displacement", worst(comm, u - exact.displacement(mesh.points)), 1e-10, "patch test"))
        gradient = exact.gradient(np.zeros((1, mesh.dim)))[0]
        strain = np.array([gradient[a, b] + gradient[b, a] * (a != b) for a, b in PAIRS[mesh.dim]])
        stress = body.moduli[0] @ strain
        checks.append(at_most(f"{kind}: stress in cells, Pa", worst(comm, cell_stresses(body, u) - stress), 1e-10, "Hooke's law"))
        checks.append(at_most(f"{kind}: stress at vertices, Pa", worst(comm, nodal_stresses(body, problem.nodes.stars, u) - stress), 1e-10, "Hooke's law"))
    return checks


@case
def fem_order():
    """Displacements converge with order 2, their gradients with order 1, to a manufactured solution"""
    comm, checks = world(), []
    for kind, sizes in (("quad", (8, 16, 32)), ("triangle", (8, 16, 32)), ("hexahedron", (4, 8, 16)), ("tetra", (4, 8, 16))):
        dim, found = 2 if kind in ("quad", "triangle") else 3, []
        for n in sizes:
            body = solid(general_mesh(comm, kind, (n,) * dim))
            exact = waves(body.tensors[0])
            problem = solve_with(body, exact)
            found.append(errors(body, problem.nodes.local(problem.nodes.displacement), exact.displacement, exact.gradient))
        orders = np.log2(np.array(found[:-1]) / found[1:])[-1]
        checks.append(Check(f"{kind}: order in L2", orders[0], 2.0, 0.1, "manufactured solution", relative=False))
        checks.append(Check(f"{kind}: order in H1", orders[1], 1.0, 0.1, "manufactured solution", relative=False))
    return checks


@case
def fem_cantilever():
    """A slender cantilever under a force at its end bends as Timoshenko's beam, and its supports take the load"""
    comm, length, height, nu, shear = world(), 10.0, 1.0, 0.3, 1e-4
    mesh = box_mesh(comm, (240, 24), (length, height))
    body, nodes = solid(mesh, nu), Nodes(mesh, False)
    root = facets_where(mesh, lambda x, n: n[:, 0] < -0.5)[0]
    end = facets_where(mesh, lambda x, n: n[:, 0] > 0.5)
    inertia = height**3 / 12

    def parabola(x, n):
        return np.stack([0 * x[:, 1], shear * 6 * x[:, 1] * (height - x[:, 1]) / height**2], axis=1)

    load = nodal_load(nodes, traction_loads(body, *end, parabola), Constant())
    problem = Static(body, nodes, NodalConditions(nodes, [load], prescribe_on_facets(body, nodes, root, (0, 1), Given([0.0, 0.0], Constant()))))
    problem.advance()
    middle = np.abs(mesh.points[: mesh.n_owned] - [length, height / 2]).max(axis=1) < 1e-9
    tip = largest(comm, float(nodes.owned(nodes.displacement)[middle, 1].max(initial=-np.inf)))
    correction = 10 * (1 + nu) / (12 + 11 * nu)  # Cowper's shear coefficient of a rectangle
    force = shear * height
    expected = force * length**3 / (3 * inertia) + force * length * 2 * (1 + nu) / (correction * height)
    checks = [Check("deflection of the tip, m", tip, expected, 0.005, "Timoshenko, Cowper")]
    held = nodes.owned(problem.conditions.constrained())
    support = comm.allreduce(np.where(held, problem.stiffness.multiply(nodes.local(nodes.displacement)), 0.0).sum(axis=0))
    checks.append(at_most("sum of support and load along y, N over the load", (support[1] + force) / force, 1e-8, "equilibrium"))
    ledger = problem.ledger()
    work, stored = (comm.allreduce(ledger[name].sum()) for name in ("external_work", "strain_energy"))
    checks.append(Check("work of the load, J", work, stored, 1e-8, "strain energy"))
    return checks


@case
def fem_loads():
    """Tractions and body forces have the resultants and moments of their integrals, whichever cells they fall on"""
    comm, checks = world(), []
    for kind, counts in COUNTS.items():
        dim = len(counts)
        mesh = general_mesh(comm, kind, counts, 0.2)
        body, nodes, upper = solid(mesh), Nodes(mesh, False), np.array([1.0, 1.2, 0.8])[:dim]
        end = facets_where(mesh, lambda x, n: n[:, 0] > 0.999)
        pressure = traction_loads(body, *end, lambda x, n: -n * (1.0 + x[:, 1:2]))  # p = 1 + y
        area = np.prod(upper[1:])
        checks.append(Check(f"{kind}: resultant of a pressure, N", -comm.allreduce(pressure[:, 0].sum()), area * (1 + upper[1] / 2), 1e-12, "integral"))
        moment = comm.allreduce((pressure[:, 0] * mesh.points[: mesh.n_owned, 1]).sum())
        checks.append(Check(f"{kind}: its moment, N m", -moment, area * (upper[1] / 2 + upper[1] ** 2 / 3), 1e-12, "integral"))
        whole = traction_loads(body, *mesh.boundary(), lambda x, n: -n)
        checks.append(at_most(f"{kind}: pressure all round, N", worst(comm, comm.allreduce(whole.sum(axis=0))), 1e-12, "Gauss"))
        weight = comm.allreduce(nodes.owned_slots.size and body.lumped_mass(nodes.stars).sum())
        checks.append(Check(f"{kind}: mass, kg", weight, np.prod(upper), 1e-12, "volume"))
    return checks


@case
def fem_same_bits():
    """Internal forces of a mesh have the same bits on all ranks together as on one rank alone, by stencils and cell by cell"""
    from mpi4py import MPI

    comm, checks = world(), []

    def hole(x):
        return (np.abs(x - 0.5) > 0.2).any(axis=1)

    makers = {
        "box of quads": lambda c: box_mesh(c, (9, 14), keep=hole), "box of hexahedra": lambda c: box_mesh(c, (5, 9, 7), keep=hole),
        "quads": lambda c: general_mesh(c, "quad", (7, 6), 0.2), "tetrahedra": lambda c: general_mesh(c, "tetra", (4, 3, 5), 0.2),
    }
    for name, make in makers.items():
        found = []
        for each in (comm, MPI.COMM_SELF):
            mesh = make(each)
            nodes, body = Nodes(mesh), solid(mesh)
            nodes.put(nodes.displacement, noise(mesh.vertex_id[: mesh.n_owned], mesh.dim))
            sweep = make_sweep(nodes, body.stiffness())
            InternalForces(nodes, sweep).evaluate()
            found.append((mesh.vertex_id[: mesh.n_owned], nodes.owned(nodes.force)))
        (ids, forces), (all_ids, alone) = found
        same = np.array_equal(forces, alone[np.searchsorted(all_ids, ids)])
        checks.append(Check(f"{name}, by {sweep.name}", float(smallest(comm, int(same))), 1.0, 0.0, "identity"))
    return checks
