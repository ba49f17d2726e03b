"""Breaking: the energy of a crack, the energy balance of a growing one, and independence of the number of ranks."""
import itertools
import json
import math
import tempfile
from pathlib import Path

import numpy as np

from pdhpc.output.fields import read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.study.verify.case import Check, at_most, case, plate, problem_of
from pdhpc.study.launch import launch


def _crossing_energy(dim, ratio, stretch, micromodulus):
    """Return the energy at critical stretch of the lattice bonds that cross a unit of crack along a lattice plane, spacing 1, by brute force."""
    reach = range(-int(ratio) - 1, int(ratio) + 2)
    total = 0.0
    for xi in itertools.product(reach, repeat=dim):
        r = math.sqrt(sum(x * x for x in xi))
        if xi[1] > 0 and r < ratio + 0.5:  # upward bonds: xi[1] of them start close enough below the plane
            total += xi[1] * 0.5 * micromodulus * min(1.0, ratio + 0.5 - r) * stretch**2 * r
    return total


@case
def crack_energy():
    """two halves pulled apart dissipate the energy release rate per crack area"""
    checks = []
    for dimension, ratio in (("plane_stress", 4.0), ("plane_strain", 4.0), ("3d", 4.0)):
        dim = 3 if dimension == "3d" else 2
        rate = 0.01
        # a crack as long as the body is wide meets bonds that would leave the body: cut the sum to the bonds that exist
        width, height = (6 * int(ratio) if dim == 2 else 2 * int(ratio) + 1), 2 * int(ratio) + 2
        cells = (width, height) if dim == 2 else (width, height, width)
        problem = problem_of(plate(cells, ratio, 1.0, "finite", material=f"energy_release_rate = {rate}", dimension=dimension))
        particles = problem.subdomain.particles
        upper = problem.subdomain.places()[:, 1] > 0
        particles.displacement[particles.slots[upper], 1] = 10 * ratio
        stepper = problem.stepper()
        law = problem.body.law
        micromodulus, limit = float(law.micromodulus[0, 0]), float(law.critical_stretch[0, 0])
        expected = _finite_crack_energy(cells, ratio, limit, micromodulus)
        checks.append(Check(f"{dimension}: dissipated energy, lattice sum", float(particles.dissipated.sum()), expected, 1e-10, "sum over the bonds across the plane"))
        per_area = _crossing_energy(dim, ratio, limit, micromodulus)
        checks.append(Check(f"{dimension}: energy per area of an endless crack, horizon/spacing {ratio:g}", per_area, rate, 0.05, "G (Silling & Askari 2005)"))
        cut = stepper.broken
        checks.append(Check(f"{dimension}: bonds broken at both ends", cut % 2, 0.0, 0.0, "every bond breaks once, at both owners"))
    return checks


def _finite_crack_energy(cells, ratio, stretch, micromodulus):
    """As _crossing_energy for the whole width of a box of `cells`: bonds with both ends in the box, spacing 1."""
    dim, total = len(cells), 0.0
    reach = range(-int(ratio) - 1, int(ratio) + 2)
    for xi in itertools.product(reach, repeat=dim):
        r = math.sqrt(sum(x * x for x in xi))
        if xi[1] > 0 and r < ratio + 0.5:
            along = [max(0, cells[axis] - abs(xi[axis])) for axis in range(dim) if axis != 1]
            total += math.prod(along) * xi[1] * 0.5 * micromodulus * min(1.0, ratio + 0.5 - r) * stretch**2 * r
    return total


GROWING_CRACK = """
title = "growing crack"
dimension = "plane_stress"
[particles]
spacing = 0.5e-3
horizon = 1.5e-3
[[material]]
name = "glass"
density = 2235
youngs_modulus = 65e9
energy_release_rate = 204
[[body]]
name = "plate"
material = "glass"
shape = "box"
lower = [0.0, -0.02]
upper = [0.06, 0.02]
[[crack]]
type = "polyline"
points = [[0.0, 0.0], [0.02, 0.0]]
[[region]]
name = "top"
shape = "box"
lower = [0.0, 0.0195]
upper = [0.06, 0.02]
[[region]]
name = "bottom"
shape = "box"
lower = [0.0, -0.02]
upper = [0.06, -0.0195]
[damage]
no_fail = ["top", "bottom"]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.0, 20e6]
[[load]]
type = "traction"
region = "bottom"
face = "-y"
value = [0.0, -20e6]
[time]
end = 20e-6
[output]
frames = 2
fields = ["displacement", "velocity", "damage"]
history_every = 1e-6
pictures = false
[[probe]]
name = "pull"
region = "top"
quantity = "reaction"
[[tip]]
name = "crack"
"""


@case
def rank_invariance():
    """a run with a growing crack has the same bits on 1, 2, 3 and 4 ranks"""
    checks = []
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "crack.toml"
        scene.write_text(GROWING_CRACK)
        reference = None
        for ranks in (1, 2, 3, 4):
            done = launch(ranks, ["run", str(scene), "-o", f"out{ranks}", "--quiet"], folder)
            if done.returncode != 0:
                return checks + [Check(f"{ranks} ranks: exit code ({done.stderr.strip()[-200:]})", done.returncode, 0.0, 0.0, "a run that ends")]
            result = _final(Path(folder) / f"out{ranks}")
            if reference is None:
                reference = result
                checks.append(Check("bonds broken", float(result["broken"] > 500), 1.0, 0.0, "the crack grows"))
            else:
                different = sum(int(np.sum(result[name] != reference[name])) for name in ("id", "displacement", "velocity", "damage"))
                checks.append(Check(f"{ranks} ranks: numbers that differ from 1 rank", different, 0.0, 0.0, "bitwise equality"))
                checks.append(Check(f"{ranks} ranks: history rows that differ", float(result["history"] != reference["history"]), 0.0, 0.0, "bitwise equality"))
    return checks


def _final(directory):
    """Return the last frame of a run sorted by particle id, and its history."""
    points = read_points(directory)
    order = np.argsort(points["id"])
    _, _, fields = read_frame(directory)
    result = {name: values[order] for name, values in fields.items()}
    result["id"] = points["id"][order]
    result["broken"] = json.loads((directory / "run.json").read_text())["broken_bonds"]
    result["history"] = (directory / "history.csv").read_text()
    return result


@case
def crack_balance():
    """the energy balance of a growing crack closes"""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "crack.toml"
        scene.write_text(GROWING_CRACK)
        done = launch(1, ["run", str(scene), "-o", "out", "--quiet"], folder)
        if done.returncode != 0:
            return [Check("exit code", done.returncode, 0.0, 0.0, "a run that ends")]
        history = read_history(Path(folder) / "out" / "history.csv")
    error = history["balance_error [J]"][-1]
    return [
        at_most("balance error over dissipated energy", error / history["dissipated_energy [J]"][-1], 0.15, "first law"),
        at_most("balance error over external work", error / history["external_work [J]"][-1], 0.01, "first law"),
    ]
