"""Time integration: oscillators, waves, conservation."""
import math

import numpy as np

from pdhpc.parallel.comm import exact_sum
from pdhpc.study.verify.case import Check, at_most, case, plate, problem_of


def _of(problem):
    """Return (n_owned, dim) displacements, m."""
    return problem.subdomain.particles.owned(problem.subdomain.particles.displacement)


def _stepper(problem, dt, displacement=None, velocity=None):
    """Return the stepper of a problem with its own step and initial state."""
    particles = problem.subdomain.particles
    if displacement is not None:
        particles.put(particles.displacement, displacement)
    if velocity is not None:
        particles.put(particles.velocity, velocity)
    problem.dt = dt
    return problem.stepper()


@case
def oscillator():
    """two bonded particles oscillate as the closed form of velocity Verlet says"""
    text = plate((2, 1), 2.0, 1.0)
    problem = problem_of(text)
    # linear: rho u1'' = c beta V (u2 - u1)/r, so the stretch u2 - u1 = 2a oscillates with omega^2 = 2 c beta V / (rho r); beta = 1, V = r = rho = 1
    omega = math.sqrt(2 * 9 / (math.pi * 2.0**3))
    dt, steps, amplitude = 0.3 / omega, 1000, 1e-3
    start = np.array([[-amplitude, 0.0], [amplitude, 0.0]])
    stepper = _stepper(problem, dt, start)
    for _ in range(steps):
        stepper.advance()
    discrete = 2 / dt * math.asin(omega * dt / 2)  # frequency of the Verlet map
    measured = _of(problem)[1, 0] / amplitude
    fine = _stepper(problem_of(text), 1e-3 / omega, start)
    for _ in range(1000):
        fine.advance()
    return [
        Check("displacement after 1000 steps, Verlet's closed form", measured, math.cos(discrete * steps * dt), 1e-12, "cos(n theta), sin(theta/2) = omega dt/2", False),
        Check("displacement at omega t = 1, small step", _of(fine)[1, 0] / amplitude, math.cos(1.0), 1e-6, "cos(omega t)"),
    ]


def _dispersion(ratio, wave_number):
    """Return omega of a longitudinal plane wave along x in the infinite 2D lattice, plane stress, E = rho = h = t = 1."""
    reach = np.arange(-int(ratio) - 1, int(ratio) + 2)
    x, y = (axis.ravel().astype(float) for axis in np.meshgrid(reach, reach))
    r = np.hypot(x, y)
    family = (r > 0) & (r < ratio + 0.5)
    x, r = x[family], r[family]
    stiffness = 9 / (math.pi * ratio**3) * np.minimum(1.0, ratio + 0.5 - r) / r
    return math.sqrt(float(np.sum(stiffness * (x / r) ** 2 * (1 - np.cos(wave_number * x)))))


@case
def plane_wave():
    """phase speed of a plane wave equals the lattice's dispersion relation, and the continuum's at long waves"""
    checks, ratio = [], 4.0
    for horizons in (4, 6, 12):
        wave_number = 2 * math.pi / (horizons * ratio)
        expected = _dispersion(ratio, wave_number)
        # a standing wave; its middle is out of reach of the edges for the quarter period that is watched
        cells = 2 * int((horizons / 4 + 8) * ratio) + 1
        problem = problem_of(plate((cells, cells), ratio, 1.0))
        x = problem.subdomain.places()[:, 0]
        centre = int(np.argmin(np.linalg.norm(problem.subdomain.places(), axis=1)))
        shape = np.zeros((len(x), 2))
        shape[:, 0] = np.cos(wave_number * x)
        stepper = _stepper(problem, 0.1 * problem.critical_dt, shape)
        before = 1.0
        while True:
            stepper.advance()
            now = _of(problem)[centre, 0]
            if now <= 0:
                break
            before = now
        quarter = stepper.time - stepper.dt * (-now) / (before - now)
        measured = 0.5 * math.pi / quarter
        checks.append(Check(f"wavelength {horizons} horizons: phase speed", measured / wave_number, expected / wave_number, 1e-3, "lattice dispersion relation"))
        if horizons == 12:
            speed = math.sqrt(1 / (1 - 1 / 9))
            checks.append(Check("wavelength 12 horizons: phase speed, continuum", measured / wave_number, speed, 0.01, "sqrt(E / (rho (1 - nu^2)))"))
    return checks


@case
def stiffness_jump():
    """reflection and transmission of a pulse at a stiffness jump follow the impedances"""
    length, ratio, stiff = 600, 3.0, 4.0
    text = plate((length, 1), ratio).replace(f"upper = [{length / 2}", "upper = [0.0") + f"""
[[material]]
name = "stiff"
density = 1.0
youngs_modulus = {stiff}
[[body]]
name = "right"
material = "stiff"
shape = "box"
lower = [0.0, -0.5]
upper = [{length / 2}, 0.5]
"""
    problem = problem_of(text)
    particles = problem.subdomain.particles
    x = problem.subdomain.places()[:, 0]
    # one row of particles: sum c beta V r = sum over both sides of 9/(pi delta^3) (1 + 2 + 3/2) E, so waves run at c1 in the left half
    speed = math.sqrt(9 / (math.pi * ratio**3) * (1 + 2 + 3 * 0.5))
    width, start = 8 * ratio, -100.0
    bump = np.exp(-(((x - start) / width) ** 2))
    displacement, velocity = np.zeros((len(x), 2)), np.zeros((len(x), 2))
    displacement[:, 0] = bump
    velocity[:, 0] = speed * 2 * (x - start) / width**2 * bump  # travels to the right: v = -c u'
    stepper = _stepper(problem, 0.5 * problem.critical_dt, displacement, velocity)
    while stepper.time * speed < 170:
        stepper.advance()
    u = particles.owned(particles.displacement)[:, 0]
    reflected, transmitted = u[x < -20], u[x > 0]
    impedances = 1.0, math.sqrt(stiff)
    return [
        Check("reflected amplitude", float(reflected[np.argmax(np.abs(reflected))]), (impedances[0] - impedances[1]) / sum(impedances), 0.02, "(Z1 - Z2)/(Z1 + Z2)"),
        Check("transmitted amplitude", float(transmitted.max()), 2 * impedances[0] / sum(impedances), 0.02, "2 Z1/(Z1 + Z2)"),
    ]


def _shaken(kinematics, cells=(24, 24), amplitude=1e-3, ratio=3.0):
    """Return a problem and a smooth random initial velocity of its particles."""
    problem = problem_of(plate(cells, ratio, 1.0, kinematics))
    x = problem.subdomain.places()
    velocity = amplitude * np.stack([np.sin(0.3 * x[:, 0]) * np.cos(0.2 * x[:, 1]) + 0.5, np.cos(0.25 * x[:, 0] + 0.1 * x[:, 1])], axis=1)
    return problem, velocity


@case
def momentum():
    """momentum of a free body is conserved to round-off"""
    from mpi4py import MPI

    checks = []
    for kinematics in ("linear", "finite"):
        problem, velocity = _shaken(kinematics)
        stepper = _stepper(problem, 0.9 * problem.critical_dt, velocity=velocity)
        particles = problem.subdomain.particles
        for _ in range(500):
            stepper.advance()
        drift = [exact_sum(MPI.COMM_SELF, particles.owned(particles.velocity)[:, axis] - velocity[:, axis]) for axis in (0, 1)]
        checks.append(at_most(f"{kinematics}: change of momentum over sum |m v|, 500 steps", max(map(abs, drift)) / np.abs(velocity).sum(), 1e-12, "Newton's third law"))
    return checks


@case
def energy_drift():
    """energy of a closed system has no trend: Verlet's own conserved energy is constant over 2000 steps"""
    from mpi4py import MPI

    checks = []
    for kinematics, tolerance in (("linear", 1e-12), ("finite", 1e-4)):
        problem, velocity = _shaken(kinematics)
        stepper = _stepper(problem, 0.5 * problem.critical_dt, velocity=velocity)
        particles, energies = problem.subdomain.particles, []
        for _ in range(20):
            for _ in range(100):
                stepper.advance()
            ledger = stepper.ledger()
            # du.(f_n + f_{n+1})/2 is the change of kinetic energy minus that of dt^2/8 m |a|^2; rho = V = 1
            correction = stepper.dt**2 / 8 * np.square(particles.owned(particles.force_density)).sum(axis=1)
            energies.append(exact_sum(MPI.COMM_SELF, ledger["kinetic_energy"] + ledger["strain_energy"] - correction))
        spread = (max(energies) - min(energies)) / np.mean(energies)
        checks.append(at_most(f"{kinematics}: spread of kinetic + strain - dt^2/8 sum m a^2 over 2000 steps", spread, tolerance, "discrete energy identity"))
    return checks


@case
def time_order():
    """velocity Verlet converges with order 2 in time"""
    def final(steps):
        problem, velocity = _shaken("finite", (12, 12), 0.05)
        end = 16 * problem.critical_dt
        stepper = _stepper(problem, end / steps, velocity=velocity)
        for _ in range(steps):
            stepper.advance()
        return problem.subdomain.particles.owned(problem.subdomain.particles.displacement).copy()

    states = [final(steps) for steps in (32, 64, 128, 256)]
    differences = [np.linalg.norm(a - b) for a, b in zip(states[:-1], states[1:])]
    return [Check(f"observed order, halving {n + 1}", math.log2(a / b), 2.0, 0.05, "Richardson") for n, (a, b) in enumerate(zip(differences[:-1], differences[1:]))]
