"""Contact and impactors: bars that collide, a sphere pressed into a block, a block that slides, a mass that strikes a bar."""
import math

import numpy as np

from pdhpc.study.verify.case import Check, at_most, case, plate, problem_of

_LENGTH = 160  # of a bar, in spacings
_SPEED = 0.01  # of colliding bodies, of sqrt(E/rho)
_EXTENT = '[[region]]\nname = "{name}"\nbody = "{name}"\nshape = "box"\nlower = [-1e4, -1e4]\nupper = [1e4, 1e4]\n'


def _bar_stiffness():
    """Return E A of a row of particles at horizon 3 spacings, plane stress, E = h = t = 1: what bonds carry across a section per unit of strain.

    k bonds of length k h cross a section, each with the force c beta_k s V^2, beta_k = min(1, 3.5 - k), and c = 9 E/(pi t delta^3).
    """
    return 9 / (math.pi * 27) * sum(k * min(1.0, 3.5 - k) for k in (1, 2, 3))


def _energy(stepper):
    """Return (what the ledger adds up to, the ledger), J."""
    ledger = {name: float(values.sum()) for name, values in stepper.ledger().items()}
    return sum(ledger.values()) - 2 * ledger["external_work"], ledger


def _colliding(stepper, steps):
    """Advance; return (time of first contact, of last contact, largest relative change of momentum, and of energy)."""
    particles = stepper.subdomain.particles
    start, ledger = _energy(stepper)
    momentum, touched, drift, change = np.abs(particles.owned(particles.velocity)).sum(), [], 0.0, 0.0
    initial = particles.owned(particles.velocity).sum(axis=0).copy()
    for _ in range(steps):
        stepper.advance()
        now, ledger = _energy(stepper)
        if ledger["contact_energy"] > 0.0:
            touched.append(stepper.time)
        change = max(change, abs(now - start) / start)
        drift = max(drift, np.abs(particles.owned(particles.velocity).sum(axis=0) - initial).max() / momentum)
    return touched[0], touched[-1], drift, change


@case
def collision():
    """two equal bars collide: they exchange velocities after 2 L/c, momentum is kept to rounding, the energy balance closes"""
    gap = 4.0  # beyond the bonds' reach of 3.5
    other = f'[[body]]\nname = "other"\nmaterial = "solid"\nshape = "box"\nlower = [{_LENGTH / 2 + gap}, -0.5]\nupper = [{1.5 * _LENGTH + gap}, 0.5]\n'
    moving = _EXTENT.format(name="body") + f'[[initial]]\nregion = "body"\nvelocity = [{_SPEED}, 0.0]\n[contact]\n'
    problem = problem_of(plate((_LENGTH, 1), kinematics="finite", extra=other + moving))
    stepper, particles = problem.stepper(), problem.subdomain.particles
    first = particles.id[: particles.n_owned] < _LENGTH
    wave = 2 * _LENGTH / math.sqrt(_bar_stiffness())  # rho A = 1
    steps = math.ceil((gap / _SPEED + 1.3 * wave) / problem.dt)
    begin, end, drift, change = _colliding(stepper, steps)
    velocity = particles.owned(particles.velocity)[:, 0]
    return [
        Check("velocity of the struck bar over that of the striking one", velocity[~first].mean() / _SPEED, 1.0, 0.02, "exchange of velocities (St. Venant)"),
        Check("velocity left to the striking bar", velocity[first].mean() / _SPEED, 0.0, 0.02, "exchange of velocities", False),
        Check("duration of contact", end - begin, wave, 0.05, "2 L/c, c of the row's own bonds"),
        at_most("change of momentum over sum |m v|", drift, 1e-13, "each pair's forces are equal and opposite"),
        at_most("change of kinetic + strain + contact energy", change, 2e-3, "conservation of energy, Verlet's O(dt^2)"),
    ]


@case
def collision_loss():
    """damped contact loses what the ledger says, and no momentum"""
    extra = '[[body]]\nname = "other"\nmaterial = "solid"\nshape = "disk"\ncenter = [14.0, 2.0]\nradius = 5.0\n' + _EXTENT.format(name="body")
    extra += f'[[initial]]\nregion = "body"\nvelocity = [{4 * _SPEED}, 0.0]\n[contact]\ndamping = 0.2\nfriction = 0.3\n'
    problem = problem_of(plate((10, 10), kinematics="finite", extra=extra))
    stepper = problem.stepper()
    _, _, drift, change = _colliding(stepper, 500)
    lost = _energy(stepper)[1]["contact_loss"] / (0.5 * 100 * (4 * _SPEED) ** 2)
    return [
        Check("energy lost to damping and friction, share of the start's", lost, 0.15, 0.14, "more than nothing, less than the energy of relative motion (0.44)", False),
        at_most("change of kinetic + strain + contact energy + losses", change, 2e-3, "first law"),
        at_most("change of momentum over sum |m v|", drift, 1e-13, "each pair's forces are equal and opposite"),
    ]


def _on_a_layer(depth_of_layer, radius, indentation):
    """Return F of a rigid sphere on an elastic layer bonded below, over Hertz's of a half space, nu = 1/4 (Dimitriadis et al. 2002, eq. 9)."""
    nu, chi = 0.25, np.sqrt(radius * indentation) / depth_of_layer
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1 - nu)
    return (1 - 2 * a / math.pi * chi + 4 * a**2 / math.pi**2 * chi**2 - 8 / math.pi**3 * (a**3 + 4 * math.pi**2 / 15 * b) * chi**3
            + 16 * a / math.pi**4 * (a**3 + 3 * math.pi**2 / 5 * b) * chi**4)


@case
def hertz():
    """force of a rigid sphere on a block grows as indentation^1.5, with the finite depth of the block taken into account"""
    radius, half, depth, speed = 40.0, 26, 32, 0.006
    held = f'[[region]]\nname = "base"\nshape = "box"\nlower = [{-half}, {-half}, {-depth / 2}]\nupper = [{half}, {half}, {2 - depth / 2}]\n'
    held += '[[load]]\ntype = "displacement"\nregion = "base"\nvalue = [0.0, 0.0, 0.0]\n'
    ball = f'[[impactor]]\nname = "ball"\nshape = "sphere"\ncenter = [0.0, 0.0, {depth / 2 + radius}]\nradius = {radius}\nvelocity = [0.0, 0.0, {-speed}]\n'
    problem = problem_of(plate((2 * half, 2 * half, depth), 2.0, kinematics="finite", dimension="3d", extra=held + ball))
    problem.dt = 0.9 * problem.critical_dt
    stepper = problem.stepper()
    impact, depths, forces = stepper.conditions.interactions[0], [], []
    while speed * stepper.time < 2.0:
        force = []
        for _ in range(30):  # averages over what is left of waves
            stepper.advance()
            force.append(-impact.forces()[:, 2].sum())
        depths.append(speed * (stepper.time - 14.5 * stepper.dt))
        forces.append(np.mean(force))
    depths, forces = np.array(depths), np.array(forces)
    used = depths > 0.2  # contact radius of 3 spacings and more
    corrected = forces[used] / _on_a_layer(depth, radius, depths[used])
    exponent, _ = np.polyfit(np.log(depths[used]), np.log(corrected), 1)
    theory = 4 / 3 / (1 - 0.25**2) * math.sqrt(radius) * depths[used] ** 1.5  # E = 1
    return [
        Check("fitted exponent of force over indentation, 0.2 to 2 spacings", exponent, 1.5, 0.05, "Hertz 1881; depth: Dimitriadis et al. 2002", False),
        Check("force over theory, mean", float(np.mean(corrected / theory)), 1.0, 0.08, "F = 4/3 E/(1 - nu^2) sqrt(R) d^1.5"),
    ]


@case
def friction():
    """a block that slides on a rigid plane decelerates at mu g, and then sticks"""
    mu, g, start, ramp = 0.3, 1e-4, 0.02, 200.0
    extra = f'[[impactor]]\nname = "floor"\nshape = "plane"\npoint = [0.0, -4.0]\nnormal = [0.0, 2.0]\nfriction = {mu}\n[[initial]]\nvelocity = [{start}, 0.0]\n'
    extra += f'[[load]]\ntype = "gravity"\nvalue = [0.0, {-g}]\ntime = {{ function = "ramp", start = 0.0, end = {ramp} }}\n'
    problem = problem_of(plate((12, 8), kinematics="finite", extra=extra))
    stepper, particles = problem.stepper(), problem.subdomain.particles
    balance, deviation, impulse = _energy(stepper)[0], [], []
    stop = start / (mu * g) + ramp / 2
    while stepper.time < 0.95 * stop:
        stepper.advance()
        t = stepper.time
        weight = g * (t * t / (2 * ramp) if t < ramp else t - ramp / 2)  # int g dt
        along, across = particles.owned(particles.velocity).mean(axis=0)
        deviation.append(abs(along - (start - mu * weight)) / start)
        impulse.append(abs(along - start + mu * (weight + across)) / start)  # friction's impulse is mu times that of the floor, m (int g dt + v_y)
    while stepper.time < 1.2 * stop:
        stepper.advance()
    after = particles.owned(particles.velocity)[:, 0].mean()
    return [
        at_most("velocity minus v0 - mu int g dt, over v0", max(deviation), 2e-3, "Coulomb; what is left is the block's bounce"),
        at_most("velocity minus v0 - mu (int g dt + v_y), over v0", max(impulse), 1e-2 * 2e-3, "impulses of floor and friction, the exact ones"),
        at_most("velocity after it should have stopped, over v0", after / start, 2e-3, "sticking"),
        at_most("balance of energies, losses included, over the start's", (_energy(stepper)[0] - balance) / balance, 1e-6, "first law"),
    ]


@case
def impact_bar():
    """a free mass that strikes a bar slows down as exp(-z t/M); momentum goes over exactly"""
    mass, length = 60.0, 300
    hammer = f'[[impactor]]\nname = "hammer"\nshape = "plane"\npoint = [{-length / 2 - 0.05}, 0.0]\nnormal = [1.0, 0.0]\nvelocity = [{_SPEED}, 0.0]\nmass = {mass}\n'
    problem = problem_of(plate((length, 1), kinematics="finite", extra=hammer))
    problem.dt = 0.15 * problem.critical_dt  # the penalty starts at once: energies are off by dt^2/8 sum m a^2
    stepper, particles = problem.stepper(), problem.subdomain.particles
    impactor = stepper.conditions.interactions[0].impactor
    impedance = math.sqrt(_bar_stiffness())  # sqrt(E A rho A)
    end = 1.8 * length / impedance  # before the wave is back
    start, checks, drift, change = _energy(stepper)[0], [], 0.0, 0.0
    marks = [0.5 * mass / impedance, mass / impedance, 2 * mass / impedance]
    while stepper.time < end:
        stepper.advance()
        momentum = mass * impactor.velocity[0] + particles.owned(particles.velocity)[:, 0].sum()
        drift = max(drift, abs(momentum / (mass * _SPEED) - 1))
        change = max(change, abs(_energy(stepper)[0] / start - 1))
        touched = stepper.time - 0.05 / _SPEED
        if marks and touched >= marks[0]:
            expected = math.exp(-impedance * touched / mass)
            checks.append(Check(f"velocity over the initial one at z t/M = {marks.pop(0) * impedance / mass:g}", impactor.velocity[0] / _SPEED, expected, 0.02, "M v' = -z v, z of the row's bonds", False))
    return checks + [
        at_most("change of the momentum of mass and bar", drift, 1e-13, "the reaction is minus the exact sum of the forces"),
        at_most("change of all energies", change, 2e-3, "first law, Verlet's O(dt^2)"),
    ]
