"""The multi-time-step method against its own mathematics: the split, the interface operators, what they conserve, where they must fail."""
import math

import numpy as np

from pdhpc.mts.ramp_response import fejer
from pdhpc.mts.strip import LinearForces, critical_step
from pdhpc.parallel.comm import exact_sum, largest, world
from pdhpc.parallel.noise import noise
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import Check, at_most, case, plate

FINE = """
[fine]
shape = "disk"
center = [0.0, 0.0]
radius = {radius}
step_ratio = {m}
"""


def coupled(m, interface="exact", cells=(24, 16), radius=3.0, share=0.65, kinematics="linear", extra="", material="", overrides=()):
    """Return the Problem, on all ranks, of a plate with a fine disk, its macro step a share of the undivided critical step."""
    text = plate(cells, kinematics=kinematics, extra=FINE.format(radius=radius, m=m) + f'interface = "{interface}"\n' + extra, material=material)
    undivided = build(parse_scene(plate(cells, kinematics=kinematics), "verification scene"), world())
    dt = share * true_step(undivided.parts[0], undivided.body.law)
    settings = [f"time.dt={dt!r}", f"time.end={1e4 * dt!r}", "time.allow_unstable=true", *overrides]
    return build(parse_scene(text, "verification scene", settings), world())


def true_step(part, law):
    """Return the critical step of a part, s, by power iteration. Collective over all ranks."""
    found = math.inf
    if part.comm.allreduce(part.subdomain.particles.n_owned):
        forces = LinearForces(part.subdomain, law, part.exchange.bind)
        found = critical_step(part.subdomain, law, forces, part.comm.allreduce, 1500)
    return -largest(world(), -found)


def shake(problem, amplitude, seed=0):
    """Add noise to every particle's velocity, the same to both copies."""
    for part in problem.parts:
        particles = part.subdomain.particles
        particles.put(particles.velocity, particles.owned(particles.velocity) + amplitude * noise(particles.id[: particles.n_owned], particles.dim, seed))


def field_by_id(view, values, comm):
    """Return {id: values} of a small body on every rank, as arrays sorted by id."""
    pieces = comm.allgather((view.ids, values))
    ids = np.concatenate([each[0] for each in pieces])
    return np.concatenate([each[1] for each in pieces])[np.argsort(ids)]


def dense(comm, apply, shape):
    """Return the matrix of a linear function of the ranks' arrays of the given shape, laid end to end in the order of ranks; on every rank."""
    n = int(np.prod(shape))
    sizes = comm.allgather(n)
    first, total = sum(sizes[: comm.rank]), sum(sizes)
    matrix = np.zeros((total, total))
    for column in range(total):
        x = np.zeros(n)
        if first <= column < first + n:
            x[column - first] = 1.0
        matrix[first : first + n, column] = np.ravel(apply(x.reshape(shape)))
    return comm.allreduce(matrix)


@case
def mts_split():
    """Shares of bonds and masses add up to the undivided body, and each region keeps its critical step"""
    comm, source = world(), "ramp split, masses by stiffness"
    checks = []
    for model in ("pmb", "lps"):
        words = "" if model == "pmb" else 'model = "lps"\npoissons_ratio = 0.2'
        text = plate((40, 28), extra=FINE.format(radius=6.0, m=2), material=words)
        split = build(parse_scene(text, "verification scene", ["time.dt=0.1"]), comm)
        whole = build(parse_scene(text, "verification scene", ["time.dt=0.1", "time.method=single"]), comm)
        forces = []
        for problem in (split, whole):
            for part in problem.parts:
                particles = part.subdomain.particles
                particles.put(particles.displacement, noise(particles.id[: particles.n_owned], 2))
            stepper = problem.stepper()
            forces.append(field_by_id(stepper.view, stepper.view.field("force_density"), comm))
        checks.append(at_most(f"{model}: force of both regions against the undivided body's", np.abs(forces[0] - forces[1]).max() / np.abs(forces[1]).max(), 1e-13, source))
        mass = sum(comm.allreduce(float((part.subdomain.particles.mass_share[part.subdomain.particles.slots]).sum())) for part in split.parts)
        checks.append(Check(f"{model}: masses of both regions", mass, 40 * 28.0, 1e-13, source))
        undivided = true_step(whole.parts[0], whole.body.law)
        for name, part, least in zip(("coarse", "fine"), split.parts, (0.99, 0.96) if model == "pmb" else (0.85, 0.85)):
            ratio = true_step(part, split.body.law) / undivided
            checks.append(Check(f"{model}: critical step of the {name} region over the undivided one is {ratio:.4f}, at least {least}", float(ratio >= least), 1.0, 0.0, source))
    return checks


@case
def mts_one_step_ratio():
    """With m = 1 the regions move as the undivided body, breaking bonds included"""
    comm = world()
    extra = '[[initial]]\nregion = "all"\nvelocity_gradient = [[1e-3, 0.0], [0.0, 3e-3]]\n'
    checks = []
    for interface in ("exact", "polynomial"):
        found = []
        for method in ("mts", "single"):
            material, settings = "critical_stretch = 0.02", [f"time.method={method}"]
            problem = coupled(1, interface if method == "mts" else "auto", (30, 20), 4.0, 0.5, "finite", extra, material, settings)
            shake(problem, 1e-4)
            stepper = problem.stepper()
            for _ in range(1000):
                stepper.advance()
            stepper.view.prepare()
            found.append((field_by_id(stepper.view, stepper.view.field("displacement"), comm), comm.allreduce(stepper.broken)))
        (u, broken), (v, expected) = found
        checks.append(at_most(f"{interface}: displacement after 1000 steps", np.abs(u - v).max() / np.abs(v).max(), 1e-12, "identity"))
        checks.append(Check(f"{interface}: broken bonds", broken, expected, 0.0, "identity"))
        checks.append(Check(f"{interface}: some break, not all", float(0 < expected < 30 * 20 * 28), 1.0, 0.0, "a case that tests something"))
    return checks


@case
def mts_operators():
    """The interface operator is symmetric, its spectrum known, CG short; the cheap operator lies above it"""
    comm, source = world(), "Fejer kernel of the ramp response"
    z = np.linspace(1e-6, 4.0, 50)
    checks = []
    for m in (2, 5, 10):
        theta = np.arccos(1 - z / (2 * m * m))
        closed = (np.sin(m * theta / 2) / (m * np.sin(theta / 2))) ** 2
        checks.append(at_most(f"m = {m}: ramp response against the Fejer kernel", np.abs(fejer(m, z) - closed).max(), 1e-12, source))
        problem = coupled(m, "exact", share=0.9)
        stepper = problem.stepper()
        exact = stepper.operator
        shape = exact.diagonal.shape
        h = dense(comm, exact.apply, shape)
        diagonal = np.concatenate(comm.allgather(exact.diagonal.ravel()))
        checks.append(at_most(f"m = {m}: asymmetry of H", np.abs(h - h.T).max() / np.abs(h).max(), 1e-13, source))
        root = 1.0 / np.sqrt(diagonal)
        spectrum = np.linalg.eigvalsh(root[:, None] * (h + h.T) / 2 * root)
        checks.append(Check(f"m = {m}: eigenvalues of D^-1 H from {spectrum[0]:.3f} to {spectrum[-1]:.3f}, within [0.70, 1]",
                            float(spectrum[0] >= 0.70 and spectrum[-1] <= 1 + 1e-12), 1.0, 0.0, source))
        regions = _regions(problem)
        tight = regions.operator(stepper.interface, problem.dt, "exact", tolerance=1e-10)
        tight.solve(noise(np.arange(shape[0]) + 1000 * comm.rank, 2))
        checks.append(Check(f"m = {m}: {tight.iterations} iterations of CG to 1e-10, at most 12", float(largest(comm, tight.iterations) <= 12), 1.0, 0.0, source))
        above = dense(comm, regions.operator(stepper.interface, problem.dt, "polynomial").apply, shape)
        lowest = np.linalg.eigvalsh(root[:, None] * ((above + above.T) / 2 - (h + h.T) / 2) * root)[0]
        checks.append(Check(f"m = {m}: lowest eigenvalue of D^-1 (D - R - H) is {lowest:.1e}, at least -1e-10", float(lowest >= -1e-10), 1.0, 0.0, "1 - c z >= F_m(z)"))
    return checks + _truncated_sum(comm)


def _truncated_sum(comm):
    """Checks of the polynomial operator: its solve lies above H, and with p >= m - 1 it responds as the link pass does."""
    checks = []
    for m in (2, 3):
        problem = coupled(m, "exact", share=0.9)
        stepper = problem.stepper()
        exact, regions = stepper.operator, _regions(problem)
        polynomial = regions.operator(stepper.interface, problem.dt, "polynomial")
        shape = exact.diagonal.shape
        inverse = dense(comm, lambda r: polynomial.solve(r.copy()), shape)
        h = dense(comm, exact.apply, shape)
        diagonal = np.concatenate(comm.allgather(exact.diagonal.ravel()))
        root = 1.0 / np.sqrt(diagonal)
        lowest = np.linalg.eigvalsh(root[:, None] * (np.linalg.inv((inverse + inverse.T) / 2) - (h + h.T) / 2) * root)[0]
        checks.append(Check(f"m = {m}: lowest eigenvalue of D^-1 (H~ - H), H~^-1 the truncated sum, is {lowest:.1e}, at least -1e-12", float(lowest >= -1e-12), 1.0, 0.0, "R >= 0"))
        x = noise(np.arange(shape[0]) + 1000 * comm.rank, 2)
        particles, found = problem.parts[1].subdomain.particles, []
        for operator in (exact, polynomial):
            fields = [getattr(particles, name) for name in ("displacement", "velocity", "force_density")]
            for each in fields:
                each[...] = 0.0
            operator.respond(x)
            found.append([each[particles.slots].copy() for each in fields])
        scale = max(largest(comm, float(np.abs(each).max(initial=0.0))) for each in found[0])
        apart = max(largest(comm, float(np.abs(a - b).max(initial=0.0))) for a, b in zip(*found))
        checks.append(at_most(f"m = {m}: response with p = 2 >= m - 1 against the link pass", apart / scale, 1e-12, "identity"))
    return checks


def _regions(problem):
    """Return the Regions that made a problem's stepper."""
    return problem.regions


@case
def mts_energy():
    """E* is conserved by multipliers, the kick's energy by kicks; H scaled by 0.98 blows up"""
    comm, checks = world(), []
    for m, words in ((2, ""), (5, ""), (10, ""), (4, 'model = "lps"\npoissons_ratio = 0.2')):
        problem = coupled(m, "exact", share=0.65 if not words else 0.5, material=words)
        m = f"{m}, lps" if words else m
        shake(problem, 1e-3)
        stepper = problem.stepper()
        stepper.operator = _regions(problem).operator(stepper.interface, problem.dt, "exact", tolerance=1e-12)
        first = exact_sum(comm, stepper.conserved_quantity())
        for _ in range(10_000):
            stepper.advance()
        last = exact_sum(comm, stepper.conserved_quantity())
        checks.append(at_most(f"m = {m}: change of E* over 1e4 macro steps", last / first - 1.0, 1e-10, "Prakash & Hjelmstad 2004"))
        gap = largest(comm, float(np.abs(stepper.interface.velocity_gap()).max(initial=0.0))) / 1e-3
        checks.append(at_most(f"m = {m}: velocity gap over largest velocity", gap, 1e-10, "constraint"))
    for m in (2, 5, 20):
        problem = coupled(m, "kick", share=0.9)
        smaller = min(true_step(part, problem.body.law) * steps for part, steps in zip(problem.parts, (1, m)))
        problem.dt = 0.98 * smaller
        shake(problem, 1e-3)
        stepper = problem.stepper()
        first = exact_sum(comm, stepper.conserved_quantity())
        for _ in range(30_000 // m):
            stepper.advance()
        last = exact_sum(comm, stepper.conserved_quantity())
        checks.append(at_most(f"kick, m = {m}: change of its energy over 3e4 sub-steps at 0.98 of the limit", last / first - 1.0, 1e-11, "elastic reflection"))
    problem = coupled(4, "exact")
    shake(problem, 1e-3)
    stepper = problem.stepper()
    solve = stepper.operator.solve
    stepper.operator.solve = lambda gap: solve(gap) / 0.98
    first = exact_sum(comm, stepper.conserved_quantity())
    steps = 0
    while steps < 2000 and not exact_sum(comm, stepper.conserved_quantity()) > 1e6 * first:
        for _ in range(50):
            stepper.advance()
        steps += 50
    checks.append(Check(f"control: with 0.98 H the energy grows a millionfold within {steps} macro steps", float(steps < 2000), 1.0, 0.0, "H below its value feeds energy in"))
    return checks


@case
def mts_three_dimensions():
    """In three dimensions, both models: m = 1 is the undivided run, and E* is conserved at m = 4"""
    comm, checks = world(), []
    for model in ("pmb", "lps"):
        words = "" if model == "pmb" else 'model = "lps"\npoissons_ratio = 0.3'
        fine = '[fine]\nshape = "sphere"\ncenter = [0.0, 0.0, 0.0]\nradius = 2.0\nstep_ratio = 4\n'
        text, found = plate((14, 12, 12), 2.0, extra=fine, material=words, dimension="3d"), {}
        for name, overrides in (("mts", ["fine.interface=exact"]), ("m = 1", ["fine.step_ratio=1"]), ("single", ["time.method=single"])):
            problem = build(parse_scene(text, "verification scene", ["time.dt=0.6", "time.end=1e3", *overrides]), comm)
            shake(problem, 1e-3)
            stepper = problem.stepper()
            if name == "mts":
                stepper.operator = _regions(problem).operator(stepper.interface, problem.dt, "exact", tolerance=1e-12)
                first = exact_sum(comm, stepper.conserved_quantity())
            for _ in range(200):
                stepper.advance()
            found[name] = field_by_id(stepper.view, stepper.view.field("displacement"), comm)
            if name == "mts":
                change = exact_sum(comm, stepper.conserved_quantity()) / first - 1.0
                checks.append(at_most(f"{model}, m = 4: change of E* over 200 macro steps", change, 1e-11, "Prakash & Hjelmstad 2004"))
        apart = np.abs(found["m = 1"] - found["single"]).max() / np.abs(found["single"]).max()
        checks.append(at_most(f"{model}, m = 1: displacement after 200 steps", apart, 1e-12, "identity"))
        moved = np.abs(found["mts"] - found["single"]).max() / np.abs(found["single"]).max()
        checks.append(Check(f"{model}, m = 4: another run than the undivided one, by {moved:.1e}", float(1e-6 < moved < 0.5), 1.0, 0.0, "a case that tests something"))
    return checks


_HELD = """
[[region]]
name = "end"
shape = "box"
lower = [-5.0, -1.5]
upper = [-4.0, 1.5]
[[load]]
type = "displacement"
region = "end"
value = [0.0, 0.0]
"""


@case
def mts_stability():
    """No growth of any motion with the polynomial operator; with degree 1 there is"""
    comm, checks = world(), []
    worst = {}
    for p, q in ((2, 1), (3, 2), (1, 1)):
        for m in (3, 5, 10, 20):
            for share in (0.45, 0.9, 0.98):
                problem = coupled(m, "exact", (10, 3), 1.0, 0.9, extra=_HELD, overrides=["particles.horizon=2.0"])
                step = share * min(true_step(part, problem.body.law) for part in problem.parts)
                problem.dt = step
                stepper = problem.stepper()
                stepper.operator = _regions(problem).operator(stepper.interface, step, "polynomial", p, q)
                radius = float(np.abs(np.linalg.eigvals(_amplification(comm, stepper))).max())
                worst[p, q] = max(worst.get((p, q), 0.0), radius - 1.0)
    for p, q in ((2, 1), (3, 2)):
        checks.append(at_most(f"(p, q) = ({p}, {q}): largest growth per macro step over 12 cases", max(0.0, worst[p, q]), 1e-9, "spectral radius of the macro step"))
    checks.append(Check(f"control: with p = q = 1 motions grow, {worst[1, 1]:.1e} per macro step", float(worst[1, 1] > 1e-6), 1.0, 0.0, "spectral radius of the macro step"))
    return checks


def _amplification(comm, stepper):
    """Return the matrix that a macro step is: (u, v, force density) of both regions and the multipliers, in natural units."""
    sides, interface = (stepper.coarse, stepper.fine), stepper.interface
    dt = stepper.dt

    def advance(x):
        position = 0
        for side in sides:
            particles = side.subdomain.particles
            count = particles.n_owned * particles.dim
            for name, scale in (("displacement", dt * dt), ("velocity", dt), ("force_density", 1.0)):
                particles.put(getattr(particles, name), scale * x[position : position + count].reshape(-1, particles.dim))
                position += count
        multiplier = x[position:].reshape(interface.fine.multiplier.shape)
        interface.fine.set_multiplier(multiplier)
        interface.coarse.set_multiplier(interface.to_coarse(multiplier))
        stepper.advance()
        found = []
        for side in sides:
            particles = side.subdomain.particles
            found += [(particles.owned(getattr(particles, name)) / scale).ravel() for name, scale in (("displacement", dt * dt), ("velocity", dt), ("force_density", 1.0))]
        return np.concatenate(found + [interface.fine.multiplier.ravel()])

    n = sum(3 * side.subdomain.particles.n_owned * side.subdomain.particles.dim for side in sides) + interface.fine.multiplier.size
    return dense(comm, advance, (n,))
