"""Meshes in motion: waves, energies, critical steps, natural frequencies, the order of Newmark's method."""
import math

import numpy as np

from pdhpc.conditions.time_functions import Constant, Ramp, Sine
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.critical_step import bound_of_cells, critical_step, estimate_step
from pdhpc.fem.explicit import Explicit
from pdhpc.fem.internal_forces import InternalForces, make_sweep
from pdhpc.fem.loads import body_loads, facets_where, gravity_loads, nodal_load, traction_loads
from pdhpc.fem.newmark import Newmark
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.static import Static
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.fem.vertex_matrix import VertexMatrix
from pdhpc.parallel.comm import exact_sum, largest, world
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.fem_problems import box_mesh, general_mesh, linear_field, solid


def left(mesh):
    """Return the facets on the left end of a box."""
    return facets_where(mesh, lambda x, n: n[:, 0] < -0.999)[0]


def right(mesh):
    """Return (facets, cell) of the right end of a box."""
    return facets_where(mesh, lambda x, n: n[:, 0] > 0.999)


def massive_nodes(body):
    """Return (Nodes with lumped masses, their sweep). Collective."""
    nodes = Nodes(body.mesh)
    nodes.set_mass(body.lumped_mass(nodes.stars))
    return nodes, make_sweep(nodes, body.stiffness())


def balance(comm, stepper, first):
    """Return the energy balance error, J: `first` is {name: J} at the start. Collective."""
    now = totals(comm, stepper)
    change = {name: now[name] - first[name] for name in now}
    return change["kinetic_energy"] + change["strain_energy"] - change["external_work"]


def totals(comm, stepper):
    """Return {name: J} of a stepper's ledger. Collective."""
    return {name: exact_sum(comm, values) for name, values in stepper.ledger().items()}


@case
def fem_bar_wave():
    """A pulse runs along a bar at the speed of sound and comes back from its free end, as d'Alembert says"""
    comm, length, cells, width = world(), 1.0, 600, 0.05
    body = solid(box_mesh(comm, (cells, 2), (length, 0.005)), 0.0)
    nodes, sweep = massive_nodes(body)
    x = body.mesh.points[: body.mesh.n_owned, 0]

    def pulse(x, t):
        return sum(np.exp(-(((x - centre) / width) ** 2)) for centre in (0.3 + t, 2 * length - 0.3 - t))  # and its image behind the free end

    nodes.put(nodes.displacement, np.stack([pulse(x, 0.0), 0 * x], axis=1))
    nodes.put(nodes.velocity, np.stack([2 * (x - 0.3) / width**2 * pulse(x, 0.0), 0 * x], axis=1))
    dt = 0.5 * length / cells
    stepper, checks = Explicit(nodes, sweep, NodalConditions(nodes), dt), []
    for t in (0.4, 1.0):
        while stepper.time < t - 0.5 * dt:
            stepper.advance()
        u, expected = nodes.owned(nodes.displacement)[:, 0], pulse(x, stepper.time)
        error = math.sqrt(exact_sum(comm, (u - expected) ** 2) / exact_sum(comm, expected**2))
        checks.append(at_most(f"displacement after the time {t}, relative", error, 5e-3, "d'Alembert"))
        front = exact_sum(comm, u * x) / exact_sum(comm, u)
        checks.append(Check(f"place of the pulse at {t}, m", front, 0.7 if t == 0.4 else 2 * length - 1.3, 5e-4, "speed of sound"))
    return checks


@case
def fem_energy():
    """Verlet's energy balance is exact but for dt^2/8 a . M a; supports that move are accounted for to order dt^2"""
    comm, checks = world(), []
    for name, mesh in (("box", box_mesh(comm, (12, 9))), ("triangles", general_mesh(comm, "triangle", (12, 9), 0.2))):
        body = solid(mesh)
        nodes, sweep = massive_nodes(body)
        pull, weight = traction_loads(body, *right(mesh), [0.3, 0.1]), gravity_loads(body, nodes.stars, [0.0, -0.2])
        loads = [nodal_load(nodes, pull, Sine(0.7)), nodal_load(nodes, weight, Ramp(0.0, 1.0))]
        stepper = Explicit(nodes, sweep, NodalConditions(nodes, loads), 0.02)
        first, kept = totals(comm, stepper), _verlet_share(comm, stepper)
        for _ in range(300):
            stepper.advance()
        scale = totals(comm, stepper)["kinetic_energy"]
        error = balance(comm, stepper, first) - (_verlet_share(comm, stepper) - kept)
        checks.append(at_most(f"{name}: balance less Verlet's share, relative", error / scale, 1e-12, "Verlet's invariant"))
    found = [_moved(comm, dt) for dt in (0.02, 0.01)]
    checks.append(Check("moving support: order of the balance error", math.log2(abs(found[0] / found[1])), 2.0, 0.2, "order of Verlet", relative=False))
    return checks


def _verlet_share(comm, stepper):
    """Return dt^2/8 a . M a, J: the energy of a state of Verlet's method less what it conserves."""
    nodes = stepper.nodes
    return stepper.dt**2 / 8 * exact_sum(comm, (nodes.owned(nodes.force) ** 2).sum(axis=1) / nodes.owned(nodes.mass))


def _moved(comm, dt):
    """Return the balance error, relative, of a body whose left end is shaken."""
    body = solid(box_mesh(comm, (12, 9)))
    nodes, sweep = massive_nodes(body)
    motions = prescribe_on_facets(body, nodes, left(body.mesh), (0, 1), Given([0.1, 0.05], Sine(0.5)))
    stepper = Explicit(nodes, sweep, NodalConditions(nodes, [], motions), dt)
    first = totals(comm, stepper)
    while stepper.time < 3.0 - 0.5 * dt:
        stepper.advance()
    return balance(comm, stepper, first) / totals(comm, stepper)["external_work"]


@case
def fem_critical_step():
    """Steps just below the critical one do not grow, above it they do; the bound by cells lies below"""
    comm, checks = world(), []
    for name, mesh in (("box", box_mesh(comm, (9, 7))), ("tetrahedra", general_mesh(comm, "tetra", (4, 3, 5), 0.2))):
        body = solid(mesh)
        nodes, sweep = massive_nodes(body)
        forces = InternalForces(nodes, sweep, nodes.new_field(), nodes.new_field())
        estimate = estimate_step(nodes, forces, 4000, 1e-7)[0]
        bound, chosen = bound_of_cells(body, body.stiffness()), critical_step(body, body.stiffness(), nodes, forces)
        checks.append(Check(f"{name}: bound by cells {bound / estimate:.3f} and step chosen {chosen / estimate:.3f} of the critical step, both below it",
                            float(bound < estimate and bound <= chosen < estimate), 1.0, 0.0, "Irons and Treharne"))
        for share, stable in ((0.995, True), (1.01, False)):
            nodes.displacement[...] = 0.0
            nodes.put(nodes.velocity, noise(mesh.vertex_id[: mesh.n_owned], mesh.dim))
            stepper = Explicit(nodes, sweep, NodalConditions(nodes), share * estimate)
            first = sum(totals(comm, stepper).values())
            for _ in range(1500 if stable else 200):
                stepper.advance()
            grown = sum(totals(comm, stepper).values()) / first
            what = f"{name}: energy grew {grown:.3g} times at {share} of the critical step"
            checks.append(Check(what, float(grown < 100), float(stable), 0.0, "stability of Verlet"))
    return checks


def quarter_period(comm, stepper, shape, x):
    """Return the mean of quarter periods over five zeros of the projection of the displacement along x on a shape. Collective."""
    zeros, before = [], None
    while len(zeros) < 5:
        now = exact_sum(comm, shape(x) * stepper.nodes.owned(stepper.nodes.displacement)[:, 0])
        if before is not None and now * before < 0:
            zeros.append(stepper.time - stepper.dt * now / (now - before))
        before = now
        stepper.advance()
    return (zeros[-1] - zeros[0]) / 8


def fixed_bar(comm, make, basis=None):
    """Return (stepper, shape, x) of a bar of length 1 and wave speed 1, held at the left, released in its lowest mode; make: function (body) -> stepper."""
    mesh = box_mesh(comm, (40, 2), (1.0, 0.05))
    body = solid(mesh, 0.0, basis=basis)
    x = mesh.points[: mesh.n_owned]
    values = np.stack([np.sin(0.5 * np.pi * x[:, 0]), 0 * x[:, 0]], axis=1)
    gradients = np.zeros((len(x), 2, 2))
    gradients[:, 0, 0] = 0.5 * np.pi * np.cos(0.5 * np.pi * x[:, 0])
    start = body.basis.interpolated(mesh, values, gradients).reshape(len(x), body.width)
    return make(body, start), lambda x: np.sin(0.5 * np.pi * x), x[:, 0]


def newmark_bar(body, start, dt=0.04):
    """Return a Newmark stepper of a bar held at its left end."""
    nodes = Nodes(body.mesh, False, body.width)
    nodes.put(nodes.displacement, start)
    motions = prescribe_on_facets(body, nodes, left(body.mesh), (0, 1), Given([0.0, 0.0], Constant()))
    return Newmark(body, nodes, NodalConditions(nodes, [], motions), dt)


def _explicit_bar(body, start):
    nodes, sweep = massive_nodes(body)
    nodes.put(nodes.displacement, start)
    motions = prescribe_on_facets(body, nodes, left(body.mesh), (0, 1), Given([0.0, 0.0], Constant()))
    return Explicit(nodes, sweep, NodalConditions(nodes, [], motions), 0.01)


@case
def fem_frequency():
    """Natural frequencies: a bar held at one end, explicit and implicit; a cantilever in bending"""
    comm, checks = world(), []
    for name, make, tolerance in (("explicit", _explicit_bar, 2e-4), ("Newmark", newmark_bar, 2e-4)):
        found = quarter_period(comm, *fixed_bar(comm, make))
        lengthened = 1.0 + (0.5 * np.pi * 0.04) ** 2 / 12 if name == "Newmark" else 1.0  # average acceleration: arctan(w dt/2) = W dt/2
        checks.append(Check(f"{name}: quarter of the bar's period, s", found, lengthened, tolerance, "L / c"))
    length, height = 20.0, 1.0
    body = solid(box_mesh(comm, (320, 16), (length, height)), 0.3)
    nodes = Nodes(body.mesh, False)
    problem = Static(body, nodes, NodalConditions(nodes, [], prescribe_on_facets(body, nodes, left(body.mesh), (0, 1), Given([0.0, 0.0], Constant()))))
    mass = VertexMatrix(body.mesh, nodes.stars, 2, (1.0, body.mass()))
    load = mass.multiply(np.ones((len(body.mesh.points), 2)) * [0.0, 1.0])
    for _ in range(4):  # inverse iteration
        problem.conditions.loads = [nodal_load(nodes, load, Constant())]
        problem.advance()
        u = nodes.local(nodes.displacement)
        inertia, pushed = mass.multiply(u), exact_sum(comm, load * u[: body.mesh.n_owned])
        square = pushed / exact_sum(comm, inertia * u[: body.mesh.n_owned])
        load = inertia * square
    expected = 1.8751040687**2 / length**2 * math.sqrt(height**2 / 12)
    checks.append(Check("cantilever: lowest frequency, rad/s", math.sqrt(square), expected, 0.005, "Euler's beam (Timoshenko's is 0.3 % lower)"))
    return checks


@case
def fem_newmark_order():
    """Newmark's method has order 2 in time, with supports that move too, and keeps energy at twenty explicit steps"""
    comm, checks = world(), []
    bars, driven = [], []
    angle = 0.5 * math.pi / 40  # of the mode over a cell: the bar of 40 cells with consistent masses has the frequency
    omega = 40 * math.sqrt(6 * (1 - math.cos(angle)) / (2 + math.cos(angle)))
    for dt in (0.2, 0.1, 0.05):
        stepper, shape, x = fixed_bar(comm, lambda body, start: newmark_bar(body, start, dt))
        for _ in range(round(5.0 / dt)):
            stepper.advance()
        bars.append(exact_sum(comm, stepper.nodes.owned(stepper.nodes.displacement)[:, 0] * shape(x)) / exact_sum(comm, shape(x) ** 2) - math.cos(5 * omega))
        driven.append(_driven_error(comm, dt))
    for name, found in (("free bar", bars), ("driven on its surface", driven)):
        checks.append(Check(f"{name}: order of the error at T", math.log2(abs(found[-2] / found[-1])), 2.0, 0.1, "order of Newmark's method", relative=False))
    stepper, _, _ = fixed_bar(comm, lambda body, start: newmark_bar(body, start, 0.5))  # critical: below 0.025
    first = totals(comm, stepper)
    for _ in range(100):
        stepper.advance()
    lost = balance(comm, stepper, first) / first["strain_energy"]
    checks.append(at_most("energy balance after 100 large steps, relative", lost, 1e-7, "average acceleration"))
    moved = largest(comm, float(np.abs(stepper.nodes.displacement).max()))
    checks.append(Check(f"largest displacement {moved:.3f} of 1 at the start, at most 1.5", float(moved < 1.5), 1.0, 0.0, "unconditional stability"))
    return checks


def _driven_error(comm, dt, frequency=0.1):
    """Return the error at T = 4 of u = -g(x) cos w t, g linear, whose surface is moved so and which the body force -rho w^2 u keeps going."""
    body, field, omega = solid(general_mesh(comm, "quad", (6, 5), 0.2)), linear_field(2).displacement, 2 * math.pi * frequency
    motion = Sine(frequency, -0.5 * math.pi)
    nodes = Nodes(body.mesh, False)
    nodes.put(nodes.displacement, -field(body.mesh.points[: nodes.n_owned]))
    load = nodal_load(nodes, body_loads(body, nodes.stars, lambda x: -(omega**2) * field(x)), motion)
    motions = prescribe_on_facets(body, nodes, body.mesh.boundary()[0], (0, 1), Given(field, motion))
    stepper = Newmark(body, nodes, NodalConditions(nodes, [load], motions), dt)
    for _ in range(round(4.0 / dt)):
        stepper.advance()
    expected = motion.value(4.0) * field(body.mesh.points[: nodes.n_owned])
    return math.sqrt(exact_sum(comm, (nodes.owned(nodes.displacement) - expected) ** 2))
