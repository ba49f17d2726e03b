"""A strip with a round hole, of particles from meshes: what its edge concentrates as horizon and particles shrink together."""
import tempfile
from pathlib import Path

import numpy as np

from pdhpc.parallel.comm import world
from pdhpc.study.verify.bars import PULL, pulled, quads_of
from pdhpc.study.verify.case import Check, case, simulation_of

HALF_LENGTH, HALF_WIDTH = 6.0, 4.0  # of the strip; the hole's radius is 1
_CELLS = 3  # of the strip to a horizon; around the hole they are finer
_SOURCE = "Kirsch 1898; finite width by Heywood 1952"
ACROSS = """[[probe]]
name = "across"
point = [0.0, 1.0]
quantity = "strain"
"""


def write_strip(path, size):
    """Write quads that fill the strip: squares of about `size` beyond the square of half side 2 around the hole, rings between that and the hole."""
    import meshio

    n = round(4 / size)  # squares along a side of that square
    size = 4 / n
    rings = _rings(n, size)
    counts = round(HALF_LENGTH / size), round(HALF_WIDTH / size)
    places = [np.arange(-count, count + 1) * size for count in counts]
    square = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    number = rings.shape[0] * rings.shape[1] + np.arange(square[..., 0].size).reshape(square.shape[:2])
    around = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    points, quads = np.concatenate([rings.reshape(-1, 2), square.reshape(-1, 2)]), quads_of(number)
    quads = quads[(np.abs(points[quads].mean(axis=1)) > 2).any(axis=1)]
    cells = np.concatenate([quads_of(np.hstack([around, around[:, :1]])), quads])
    meshio.Mesh(np.hstack([points, np.zeros((len(points), 1))]), [("quad", cells)]).write(path)


def _rings(n, size):
    """Return (rings + 1, 4 n, 2): points on lines from the hole to the square's sides, n points to a side, rings as thick as their cells are wide."""
    along = np.arange(n) * size - 2
    whole = np.full(n, 2.0)
    sides = np.concatenate([np.stack(side, axis=1) for side in ((whole, along), (-along, whole), (-whole, -along), (along, -whole))])
    angle = 2 * np.pi * np.arange(4 * n) / (4 * n) - np.pi / 4
    circle, inner = np.stack([np.cos(angle), np.sin(angle)], axis=1), 2 * np.pi / (4 * n)
    count = int(np.ceil(1.3 / (0.5 * (inner + size))))  # 1.3: mean way from the hole to the square
    thick = np.geomspace(inner, size, count)
    share = np.concatenate([[0.0], np.cumsum(thick) / thick.sum()])
    return circle + share[:, None, None] * (sides - circle)


def concentration(horizon, material=""):
    """Return E times the strain along the pull at the hole's edge, across the pull, over the pull: 3 in an endless plate of local elasticity."""
    size = horizon / _CELLS
    with tempfile.TemporaryDirectory(prefix=f"pdhpc_{world().rank}_") as folder:
        file = Path(folder) / "strip.vtk"
        write_strip(file, size)
        body = f'shape = "mesh"\nfile = "{file}"'
        text = pulled(HALF_LENGTH, horizon, size, body, 'volume_correction = "none"', material) + ACROSS
        simulation = simulation_of(text)
    simulation.stepper.advance()
    return simulation.probes[0].read(simulation.stepper)[0] / PULL


def of_wide_plate(found):
    """Return a concentration in this strip as that in an endless plate: times 3 over (2 + (1 - d/W)^3)/(1 - d/W)."""
    rest = 1 - 1 / HALF_WIDTH
    return 3 * found * rest / (2 + rest**3)


def _converges(what, material):
    """Return Checks of the concentration for horizons of 1/3, 1/4 and 1/6 of the radius, and of the parabola through them at 0."""
    horizons = np.array([1 / 3, 1 / 4, 1 / 6])
    found = np.array([of_wide_plate(concentration(horizon, material)) for horizon in horizons])
    limit = float(np.polyfit(horizons, found, 2)[-1])
    numbers = ", ".join(f"{each:.2f}" for each in found)
    rises = float(np.all(np.diff(3 - found) < 0) and found[-1] < 3)
    return [
        Check(f"{what}: concentration at horizon -> 0", limit, 3.0, 0.08, _SOURCE),
        Check(f"{what}: it rises as the horizon falls to 1/3, 1/4, 1/6 of the radius ({numbers})", rises, 1.0, 0.0, "averages over a horizon"),
        Check(f"{what}: half the horizon, what is lacking over what was", (3 - found[2]) / (3 - found[0]), 0.5, 0.15, "order 1", False),
    ]


@case
def plate_with_hole():
    """a strip with a hole, of particles from meshes, concentrates a pull by 3 (wide plate) as the horizon goes to 0"""
    return _converges("pmb", "")


@case(slow=True)
def plate_with_hole_lps():
    """the same of the state-based material, Poisson's ratio 0.3, which averages over two horizons"""
    return _converges("lps", 'model = "lps"\npoissons_ratio = 0.3')
