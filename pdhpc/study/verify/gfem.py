"""Finite elements enriched by local peridynamics: the parts of the coupled step one by one, and where it must fail."""
import math

import numpy as np

from pdhpc.parallel.comm import largest, world
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import Check, at_most, case, plate
from pdhpc.study.verify.gfem_control import blend_by_a_step
from pdhpc.study.verify.gfem_plate import CELL, HEIGHT, Plate, coupled_problem, errors, observe, run_full, set_in_motion, words
from pdhpc.study.verify.mts import field_by_id

_SOURCE = "prototype"


def share(condition, what, source=_SOURCE):
    """Return a Check of something that holds or does not; the numbers stand in `what`."""
    return Check(what, float(condition), 1.0, 0.0, source)


@case
def gfem_ghost_force():
    """Forces that the blend of particles and elements causes in a body under uniform strain, against a blend without a ramp"""
    checks, ramped = [], {}
    for ratio in (5, 10, 15):
        stepper = Plate(ratio, k=ratio).coupled().stepper()
        ramped[ratio] = stepper.ghost_force()
        blend_by_a_step(stepper)
        times = stepper.ghost_force() / ramped[ratio]
        wanted = 5 <= times <= 10 if ratio == 5 else times >= 5
        words_of_bound = "5 to 10" if ratio == 5 else "at least 5"
        checks.append(share(wanted, f"H/h = {ratio}, control: a step in the place of the ramp gives {times:.2f} times as much, {words_of_bound}"))
    checks.insert(0, at_most("H/h = 5: largest force on a vertex over sigma H", ramped[5], 0.05, _SOURCE))
    checks.append(share(ramped[5] > ramped[10] > ramped[15], f"it falls with H/h = 5, 10, 15: {words(ramped.values())}"))
    return checks


_SQUARE = 80  # particles along a side of the unit square whose window is driven by its collar
_WIDTH = 3.2 / _SQUARE  # of the pulse


def _pulse(x):
    """Return (u, v) of a plane wave that travels along x."""
    speed, away = math.sqrt(9 / 8), (x[:, 0] - 0.15) / _WIDTH
    u = np.exp(-(away**2))
    zero = np.zeros_like(u)
    return np.stack([u, zero], axis=1), np.stack([2 * speed * away / _WIDTH * u, zero], axis=1)


def _pulsing(text):
    """Return the VelocityVerlet of particles everywhere, in which a pulse runs along x. Collective."""
    problem = build(parse_scene(text, "verification scene"), world())
    problem.dt = 0.3 * math.sqrt(0.5) * problem.critical_dt  # 0.3 of sqrt(2 rho / sum c beta V/|xi|), a bound without directions
    particles = problem.subdomain.particles
    displacement, velocity = _pulse(problem.subdomain.places() + 0.5)
    particles.put(particles.displacement, displacement)
    particles.put(particles.velocity, velocity)
    return problem.stepper()


def _window(text, cell, k, tau, order):
    """Return the _Window of 6 x 6 cells around the middle. Collective."""
    stepper = coupled_problem(text, cell, k, ["model=gfem", f"time.dt={k * tau!r}", "time.allow_unstable=true"]).stepper()
    mesh = stepper.solution.mesh
    stepper.patches.add(np.abs(mesh.points[mesh.cells[: mesh.n_owned_cells]].mean(axis=1)).max(axis=1) < 2.1 * cell)
    stepper.follow()
    return _Window(stepper, order)


def _collar_errors(k, orders):
    """Return [largest error of a window of particles over the largest displacement in it] for collars that follow polynomials of these orders. Collective."""
    comm, text = world(), plate((_SQUARE, _SQUARE), 3.015, 1 / _SQUARE)
    full = _pulsing(text)
    windows = [_window(text, 5 / _SQUARE, k, full.dt, order) for order in orders]

    def everywhere():
        return [field_by_id(full.view, values, comm) for values in (full.view.field("displacement"), full.view.field("velocity"), full.acceleration())]

    found, peak, state = np.zeros(len(orders)), 0.0, everywhere()
    for window in windows:
        window.seed(*state[:2])
    for _ in range(int(1.0 / (k * full.dt))):
        for window in windows:
            window.run(k, full.dt, state)
        for _ in range(k):
            full.advance()
        state = everywhere()
        found = np.maximum(found, [largest(comm, window.error(state[0])) for window in windows])
        peak = max(peak, largest(comm, windows[0].size(state[0])))
    return found / peak


class _Window:
    """The local particles of a coupled step alone, their collar driven by a polynomial in time of an order up to 2, from the state of all particles."""

    def __init__(self, stepper, order):
        self.local, self.order = stepper.local, order
        particles = self.local.subdomain.particles
        self._id = np.full(len(particles.position), -1, np.int64)
        self._id[np.concatenate([particles.slots, particles.ghost_slots])] = particles.id
        self._slots = self.local.points.slots

    def seed(self, u, v):
        """Take the state of all particles."""
        particles = self.local.subdomain.particles
        particles.position[self._slots], particles.velocity[self._slots] = u[self._id[self._slots]], v[self._id[self._slots]]
        self.local.refresh()

    def run(self, k, tau, state):
        """Do k sub-steps. Collective over neighbours."""
        collar = self.local.collar
        for order, (held, values) in enumerate(zip((collar.displacement, collar.velocity, collar.acceleration), state)):
            held[:] = values[self._id[collar.slots]] if order <= self.order else 0.0
        self.local.start(k, tau, 0.0)
        self.local.run()

    def error(self, u):
        """Return the largest difference of displacements. Local."""
        return float(np.abs(self.local.subdomain.particles.position[self._slots] - u[self._id[self._slots]]).max(initial=0.0))

    def size(self, u):
        """Return the largest displacement. Local."""
        return float(np.abs(u[self._id[self._slots]]).max(initial=0.0))


@case
def gfem_collar():
    """A window of particles whose collar follows the whole body by polynomials of order 0, 1, 2 in each step"""
    found = _collar_errors(5, (0, 1, 2))
    return [
        at_most("order 2: largest error over the largest displacement in the window", found[2], 0.05, _SOURCE),
        share(found[2] < 0.5 * found[1], f"orders 0, 1, 2: {words(found)}; the last is less than half of the one before"),
    ]


@case
def gfem_everywhere():
    """Particles everywhere and no tolerance: the coefficients of the enriched space give back peridynamics, broken bonds included"""
    body = Plate(5, 4, 1.3, 0.003, 0.02, length=0.5)
    problem = body.coupled("gfem.scheme=galerkin", "gfem.tolerance=0.0", "gfem.everywhere=true")
    result = observe(problem.stepper(), problem.n_steps)
    reference = run_full(body, problem.dt, problem.n_steps)
    return [
        at_most("displacement against particles alone, largest of four times", errors(result, reference).max(), 1e-6, "identity"),
        Check("broken bonds", result.broken, reference.broken, 0.0, "identity"),
        share(reference.broken > 100, f"{reference.broken} bonds break", "a case that tests something"),
    ]


@case
def gfem_moduli():
    """Moduli of the lattice's own bonds inside a body, plane stress, c such that the lattice's sum is 6 E"""
    h, horizon = CELL / 5, 3.015 * CELL / 5
    problem = Plate(notched=False).coupled()
    material, mesh = problem.coupled_parts.material, problem.coupled_parts.mesh
    centre = np.flatnonzero((np.abs(mesh.points[mesh.cells[: mesh.n_owned_cells]].mean(axis=1) - [0.5125, HEIGHT / 2 + CELL / 2]) < 1e-6).all(axis=1))
    mine = material.moduli[material.kind[centre]].reshape(-1, 3, 3)
    c = np.array(world().allreduce(mine.tolist()))[0]
    offset = np.stack(np.meshgrid(np.arange(-4, 5), np.arange(-4, 5)), axis=-1).reshape(-1, 2) * h
    length = np.linalg.norm(offset, axis=1)
    weight = np.clip((horizon + h / 2 - length) / h, 0.0, 1.0)
    scale = 6.0 / (9.0 / (math.pi * horizon**3) * (weight * length).sum() * h * h)
    found = {"C11": c[0, 0], "C22": c[1, 1], "C12": c[0, 1], "C66": c[2, 2]}
    expected, source = {"C11": 1.1394, "C22": 1.1394, "C12": 0.3606, "C66": 0.3606}, "Cauchy's relations of a square lattice"
    checks = [Check(f"{name} over E", value * scale, expected[name], 1e-3, source) for name, value in found.items()]
    return [*checks, at_most("shear coupling C16, C26", np.abs(c[:2, 2]).max(), 1e-12, "symmetry")]


def _blow(x):
    """Return the velocity, along the plate, of a blow at the middle of its left end."""
    away = (x - [0.0, HEIGHT / 2]) / 0.12
    return 0.01 * np.exp(-(away**2).sum(axis=1))[:, None] * np.array([1.0, 0.0])


@case
def gfem_intact():
    """Elements alone against particles: a free pulse, with the moduli of the lattice and with those of the continuum"""
    body, comm, found = Plate(5, 4, 0.65, notched=False), world(), {}
    for moduli in ("lattice", "continuum"):
        problem = body.coupled(f"fem.moduli={moduli}")
        stepper = problem.stepper()
        set_in_motion(stepper, np.zeros_like, _blow, body)
        result = observe(stepper, problem.n_steps)
        full = body.full(problem.dt / body.k)
        particles = full.subdomain.particles
        particles.put(particles.velocity, _blow(full.subdomain.places()))
        found[moduli] = errors(result, observe(full.stepper(), problem.n_steps, body.k))
    patches = comm.allreduce(int(stepper.patches.chosen.sum()))
    return [
        at_most(f"error of the displacement at T = 0.65 (at its quarters {words(found['lattice'])})", found["lattice"][3], 0.02, _SOURCE),
        share(found["continuum"][3] > 0.03, f"control, moduli of the continuum: error {found['continuum'][3]:.4f} exceeds 0.03"),
        Check("patches", patches, 0, 0.0, "a case that tests elements alone"),
    ]


@case
def gfem_step():
    """A step above 0.8 of the critical one is refused; 0.73 of it is stable, 1.02 is not"""
    body, comm, checks = Plate(5, "auto", 1e3, 0.001), world(), []
    critical = body.coupled().critical_dt
    for part, expected in ((0.79, False), (0.81, True)):
        try:
            refused = False
            body.coupled(f"time.dt={part * critical!r}")
        except SceneError:
            refused = True
        checks.append(share(refused == expected, f"{part} of the critical step is {'refused' if refused else 'taken'}", "stability"))
    for part in (0.73, 1.02):
        stepper = body.coupled(f"time.dt={part * critical!r}", "time.allow_unstable=true").stepper()
        size = []
        for _ in range(300):
            stepper.advance()
            size.append(largest(comm, float(np.abs(stepper.solution.displacement).max(initial=0.0))))
            if not size[-1] < 1e3:
                break
        stable = len(size) == 300 and size[-1] < 0.1
        checks.append(share(stable == (part < 0.8), f"{part} of it: largest displacement {size[-1]:.2e} after {len(size)} steps, load 0.001"))
    return checks
