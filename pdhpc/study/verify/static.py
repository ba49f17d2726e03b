"""Bodies that stand still: moduli, beams, columns under their weight, and a strip that tears."""
import itertools

import numpy as np

from pdhpc.conditions.loads import PrescribedMotion
from pdhpc.conditions.time_functions import Ramp
from pdhpc.materials.law import family_radius
from pdhpc.study.verify.case import Check, at_most, case, plate, problem_of, simulation_of
from pdhpc.study.verify.elasticity import _discrete_energy, lattice_vectors
from pdhpc.study.verify.state_based import _lattice_energy, _solid

METHODS = ("relaxation", "newton")
_NU = 0.3  # of the LPS bodies here
HELD = """
[[region]]
name = "held"
shape = "half_space"
point = {point}
normal = {normal}
[[load]]
type = "displacement"
region = "held"
value = {value}
"""


def still(cells, method, model="pmb", kinematics="linear", dimension="plane_stress", extra="", tolerance=1e-10, material="", steps=1, held=None):
    """Return the text of a box of E = rho = 1 on a lattice of spacing 1, horizon 3; where x < -cells[0]/2 + 3 components `held` (default all 0.0) are prescribed."""
    rest = [0.0] * (len(cells) - 1)
    held = HELD.format(point=[3.0 - cells[0] / 2, *rest], normal=[-1.0, *rest], value=held or [0.0, *rest])
    table = f"[static]\nsteps = {steps}\ntolerance = {tolerance}\n"
    text = plate(cells, 3.0, 1.0, kinematics, extra=held + table + extra, dimension=dimension, material=_solid(_NU, material) if model == "lps" else material)
    return text.replace("end = 1.0\n", f'end = 1.0\nmethod = "{method}"\n', 1)


def lattice_moduli(model, dimension):
    """Return (E, nu, G) along the axes of a whole lattice, horizon 3, from its energies: C11 = 2 W(e_xx), C12 from W of a change of size, G = 2 W(shear)."""
    dim = 3 if dimension == "3d" else 2

    def energy(gradient):
        return _discrete_energy(dimension, 3.0, gradient, False) if model == "pmb" else _lattice_energy(dimension, _NU, 3.0, gradient, False)

    pull, shear = np.zeros((dim, dim)), np.zeros((dim, dim))
    pull[0, 0] = shear[0, 1] = 1.0
    c11 = 2 * energy(pull)
    c12 = (2 * energy(np.eye(dim)) - dim * c11) / (dim * (dim - 1))
    lateral = c12 / (c11 + (dim - 2) * c12)
    return c11 - (dim - 1) * c12 * lateral, lateral, 2 * energy(shear)


@case
def static_bar():
    """a bar whose rim is stretched evenly takes the stretch, and has the modulus of its lattice"""
    checks, strain = [], 1e-3
    for (dimension, cells), model, method in itertools.product((("plane_stress", (24, 16)), ("3d", (17, 15, 15))), ("pmb", "lps"), METHODS):
        problem = problem_of(still(cells, method, model, dimension=dimension))
        particles, places, dim = problem.subdomain.particles, problem.subdomain.places(), len(cells)
        modulus, nu, _ = lattice_moduli(model, dimension)
        gradient = strain * np.diag([1.0] + [-nu] * (dim - 1))
        depth = (2 if model == "lps" else 1) * family_radius(3.0, 1.0, "linear")  # forces of lps reach two families
        rim = (np.abs(places) > np.array(cells) / 2 - depth).any(axis=1)
        motion = PrescribedMotion(particles.slots[rim], range(dim), places[rim] @ gradient, Ramp(0.0, 1.0), "displacement")
        problem.conditions.motions[:] = [motion]
        stepper = problem.stepper()
        stepper.advance()
        u, centre = stepper.view.field("displacement"), int(np.argmin(np.linalg.norm(places, axis=1)))
        stress = stepper.view.field("stress")[centre] / strain
        name = f"{dimension}, {model}, {method}"
        checks.append(at_most(f"{name}: largest difference from the even stretch", float(np.abs(u - places @ gradient).max() / np.abs(u).max()), 1e-8, "symmetry of the lattice"))
        checks.append(Check(f"{name}: stress over strain along the bar", float(stress[0, 0]), modulus, 1e-8, "E of the lattice sum"))
        checks.append(at_most(f"{name}: stress across", float(np.abs(np.diag(stress)[1:]).max() / modulus), 1e-8, "uniaxial"))
    return checks


COLUMN = """
[[load]]
type = "displacement"
region = "all"
value = ["free", 0.0]
[[load]]
type = "gravity"
value = [-1e-5, 0.0]
"""


@case
def static_column():
    """a chain of particles under its own weight: the slope in the middle is the weight above it over the stiffness of the chain"""
    checks, n, gravity = [], 80, 1e-5
    for model, method in itertools.product(("pmb", "lps"), METHODS):
        problem = problem_of(still((n, 1), method, model, extra=COLUMN, held=[0.0, "free"]))
        stepper = problem.stepper()
        stepper.advance()
        u = stepper.view.field("displacement")[:, 0]
        stiffness = _chain_stiffness(model, problem.body.law)
        checks.append(Check(f"{model}, {method}: slope in the middle", float(u[n // 2] - u[n // 2 - 1]), -gravity * (n - n // 2) / stiffness, 1e-8, "equilibrium of the upper half"))
    return checks


def _chain_stiffness(model, law):
    """Return the force through a section of an endless chain of spacing 1, horizon 3, over its slope: bonds of r = 1, 2, 3, r of which cross each section.

    pmb: sum_r r c beta. lps: theta = 2 slope and m = 2 sum beta r^2, so that a bond carries 2 beta/m ((2 k - 4 G) theta r + 8 G r slope), in all (4 k - 8 G + 8 G) slope.
    """
    r, beta = np.array([1.0, 2.0, 3.0]), np.array([1.0, 1.0, 0.5])
    return float(np.sum(r * law.micromodulus[0, 0] * beta)) if model == "pmb" else 4 / (2 * (1 - _NU))


@case
def static_cantilever():
    """a cantilever bends as Timoshenko's beam of the lattice's moduli, but for a skin of a horizon"""
    checks = []
    for model in ("pmb", "lps"):
        errors = [_beam_error(model, "newton", height) for height in (24, 48)]
        checks.append(at_most(f"{model}: tip of a beam 5 heights long, 16 horizons high, over the beam's, less 1", errors[1], 0.07, "Timoshenko 1921"))
        checks.append(Check(f"{model}: error falls with horizon over height", float(abs(errors[1]) < 0.7 * abs(errors[0])), 1.0, 0.0, "skin of a horizon"))
        checks.append(Check(f"{model}: relaxation finds the tip of 8 horizons where newton does", _beam_error(model, "relaxation", 24), errors[0], 1e-3, "one equilibrium"))
    return checks


def _beam_error(model, method, height):
    """Return tip deflection over w = P l^3/(3 E I) + P l/(kappa G A), less 1, of a beam 5 heights long; kappa of Cowper 1966."""
    length, pull = 5 * height, 1e-6
    end = (length + 3) / 2
    tip = f'[[region]]\nname = "tip"\nshape = "half_space"\npoint = [{end - 1}, 0.0]\nnormal = [1.0, 0.0]\n[[load]]\ntype = "traction"\nregion = "tip"\nface = "+x"\nvalue = [0.0, {pull}]\n'
    problem = problem_of(still((length + 3, height), method, model, extra=tip, tolerance=1e-7))
    stepper = problem.stepper()
    stepper.advance()
    x = problem.subdomain.places()
    moved = stepper.view.field("displacement")[x[:, 0] > end - 1, 1].mean()
    modulus, nu, shear = lattice_moduli(model, "plane_stress")
    reach, kappa = length - 0.5, (10 + 10 * nu) / (12 + 11 * nu)
    return float(moved / (pull * height * (reach**3 / (3 * modulus * height**3 / 12) + reach / (kappa * shear * height))) - 1)


NOTCH = """
[[region]]
name = "pulled"
shape = "half_space"
point = [{low}, 0.0]
normal = [1.0, 0.0]
[damage]
no_fail = ["held", "pulled"]
[[crack]]
type = "polyline"
points = [[0.0, {bottom}], [0.0, {tip}]]
[[load]]
type = "displacement"
region = "pulled"
value = [{pull}, 0.0]
time = {{ function = "ramp", end = 1.0 }}
[[probe]]
name = "grip"
region = "pulled"
quantity = "reaction"
"""


def notched(method, breaking="all", model="pmb", kinematics="linear", steps=10, cells=(50, 30)):
    """Return the text of a strip, notched by a third, that is pulled apart by a hundredth of its length in `steps` load steps."""
    notch = NOTCH.format(low=cells[0] / 2 - 3, bottom=-cells[1] / 2 - 1, tip=-cells[1] / 6, pull=cells[0] / 100)
    text = still(cells, method, model, kinematics, extra=notch, tolerance=1e-7, material="critical_stretch = 0.01", steps=steps)
    return text.replace("[static]\n", f'[static]\nbreaking = "{breaking}"\n')


@case
def static_notch():
    """a notched strip under displacement control tears: its load drops, the energy balance closes, and both methods break the same bonds"""
    checks, alive = [], {}
    for method, breaking in (("relaxation", "all"), ("newton", "all"), ("newton", "most_strained")):
        simulation = simulation_of(notched(method, breaking))
        rows = []
        while simulation.stepper.step < 10:
            simulation.stepper.advance()
            rows.append([simulation.probes[0].read(simulation.stepper)[0], simulation.stepper.residual, simulation.stepper.broken])
            simulation.energies.read(simulation.stepper)
        pulls, residuals, broken = np.array(rows).T
        alive[method, breaking] = simulation.problem.subdomain.bonds.alive()
        name, found = f"{method}, {breaking}", simulation.energies.latest
        before = pulls[: int(np.argmax(broken > 0))]
        checks.append(at_most(f"{name}: load over displacement before bonds break, spread", float(np.ptp(before / np.arange(1, len(before) + 1)) / before[0]), 1e-5, "linear"))
        checks.append(at_most(f"{name}: load at the end over the largest", float(pulls[-1] / pulls.max()), 0.05, "torn"))
        checks.append(at_most(f"{name}: largest residual", float(residuals.max()), 1e-7, "static.tolerance"))
        checks.append(at_most(f"{name}: balance error over external work", found["balance_error"] / found["external_work"], 1e-5, "first law"))
        released = float(simulation.problem.subdomain.particles.dissipated.sum())
        law = simulation.problem.body.law
        checks.append(Check(f"{name}: energy released by bonds over that of those across the ligament", released / _ligament_energy(law), 1.0, 0.3, "c omega beta s0^2 r/2 each"))
        checks.append(Check(f"{name}: dissipated energy is no less", float(found["dissipated_energy"] >= released), 1.0, 0.0, "what moves away is damped"))
    differ = int((alive["relaxation", "all"] != alive["newton", "all"]).sum())
    checks.append(Check("particles whose intact bonds differ between the methods", differ, 0.0, 0.0, "one path of equilibria"))
    return checks


def _ligament_energy(law):
    """Return the energy at critical stretch of the bonds across x = 0 of which both ends lie above y = -5 in a strip up to y = 15: 20 rows of spacing 1."""
    xi = lattice_vectors(2, 3.0)
    xi = xi[xi[:, 0] > 0]
    r = np.linalg.norm(xi, axis=1)
    number = xi[:, 0] * (20 - np.abs(xi[:, 1]))
    return float(np.sum(number * 0.5 * law.micromodulus[0, 0] * np.minimum(1.0, 3.5 - r) * law.critical_stretch[0, 0] ** 2 * r))
