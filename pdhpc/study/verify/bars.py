"""Bars and strips held at one end, pulled at the other, and brought to rest."""
import tempfile
from pathlib import Path

import numpy as np

from pdhpc.parallel.comm import world
from pdhpc.study.verify.case import Check, case, problem_of

PULL = 1e-3  # traction at the end, E = 1
_PULLED = """
dimension = "{dimension}"
[particles]
spacing = {size}
horizon = {horizon}
kinematics = "linear"
{particles}
[[material]]
name = "solid"
density = 1.0
youngs_modulus = 1.0
{material}
[[body]]
name = "bar"
material = "solid"
{body}
[[region]]
name = "left"
shape = "half_space"
point = {left}
normal = {back}
[[region]]
name = "right"
shape = "half_space"
point = {right}
normal = {front}
[[region]]
name = "pin"
shape = "box"
lower = {low}
upper = {high}
[[load]]
type = "displacement"
region = "left"
value = {held}
[[load]]
type = "displacement"
region = "pin"
value = {kept}
[[load]]
type = "traction"
region = "right"
face = "+x"
value = {pull}
[time]
end = 1.0
method = "newton"
[static]
steps = 1
[output]
pictures = false
"""


def pulled(half_length, horizon, size, body, particles="", material="", dimension="plane_stress"):
    """Return the text of a body in |x| < half_length, E = rho = 1, held along x in a layer of a horizon at its left end, in the middle of it across too, and pulled.

    size : of the particles. body, particles, material : lines of these tables.
    """
    rest = 2 if dimension == "3d" else 1
    layer, zeros, free = half_length - horizon, [0.0] * rest, ["free"] * rest

    def words(values):
        return "[" + ", ".join(f'"{each}"' if isinstance(each, str) else repr(float(each)) for each in values) + "]"

    return _PULLED.format(
        dimension=dimension, size=size, horizon=horizon * (1 + 1e-4), particles=particles, material=material, body=body, left=words([-layer, *zeros]),
        back=words([-1, *zeros]), right=words([layer, *zeros]), front=words([1, *zeros]), low=words([-half_length] + [-1.01 * size] * rest),
        high=words([-layer] + [1.01 * size] * rest), held=words([0, *free]), kept=words(["free", *zeros]), pull=words([PULL, *zeros]))


def _modulus(text, half_length):
    """Return the traction over the slope of the displacement in the middle half of a bar, by least squares."""
    problem = problem_of(text)
    stepper = problem.stepper()
    stepper.advance()
    x, u = problem.subdomain.places()[:, 0], stepper.view.field("displacement")[:, 0]
    middle = np.abs(x) < half_length / 2
    return float(PULL / np.polyfit(x[middle], u[middle], 1)[0])


def _box(cells):
    """Return the lines of a box of `cells` of side 1, centred on 0."""
    half = [count / 2 for count in cells]
    return f'shape = "box"\nlower = {[-each for each in half]}\nupper = {half}'


def write_uneven(path, cells):
    """Write quads of sides between 0.6 and 1.5, their inner vertices moved by up to a fifth, that fill a box of `cells` (2), centred on 0."""
    import meshio

    sides = [1.5 ** np.sin(2 * np.pi * (np.arange(count) + 0.5) / 17) for count in cells]
    axes = [np.concatenate([[0.0], np.cumsum(side)]) * count / side.sum() - count / 2 for side, count in zip(sides, cells)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points[1:-1, 1:-1] += np.random.default_rng(1).uniform(-0.2, 0.2, points[1:-1, 1:-1].shape)
    points = points.reshape(-1, 2)
    number = np.arange(len(points)).reshape([count + 1 for count in cells])
    meshio.Mesh(np.hstack([points, np.zeros((len(points), 1))]), [("quad", quads_of(number))]).write(path)


def quads_of(number):
    """Return (n, 4) the corners of the quads of a grid of vertices `number` (rows, columns), each in order around its quad."""
    return np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)


@case
def bar_stretch():
    """a bar four horizons wide, held, pulled and brought to rest, has Young's modulus within 2 % with surfaces corrected, on a lattice and of uneven cells"""
    checks, keys = [], 'surface_correction = "{}"\npath = "cloud"\nvolume_correction = "{}"'.format
    for dimension, cells, ratio in (("plane_stress", (80, 16), 4.0), ("3d", (48, 12, 12), 3.0)):
        half = cells[0] / 2
        found = {each: _modulus(pulled(half, ratio, 1.0, _box(cells), keys(each, "linear"), dimension=dimension), half) for each in ("none", "energy")}
        checks.append(Check(f"{dimension}, a lattice: E with correction (without: {found['none']:.3f})", found["energy"], 1.0, 0.02, "E of the material"))
    cells, ratio = (80, 16), 4.0
    half = cells[0] / 2
    with tempfile.TemporaryDirectory(prefix=f"pdhpc_{world().rank}_") as folder:
        file = Path(folder) / "uneven.vtk"
        write_uneven(file, cells)
        body = f'shape = "mesh"\nfile = "{file}"'
        found = {each: _modulus(pulled(half, ratio, 1.0, body, keys(each, "none")), half) for each in ("none", "energy")}
    checks.append(Check(f"plane_stress, cells of 0.6 to 1.5: E with correction (without: {found['none']:.3f})", found["energy"], 1.0, 0.02, "E of the material"))
    return checks
