"""Bodies from files: the same particles from a table, from a mesh, and from the lattice that they coincide with."""
import tempfile
from pathlib import Path

import numpy as np

from pdhpc.parallel.comm import world
from pdhpc.scene.body import make_body
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import Check, at_most, case, problem_of

CRACKED = """
dimension = "{dimension}"
[particles]
spacing = 1.0
horizon = {horizon}
path = "cloud"
[[material]]
name = "solid"
density = 1.0
youngs_modulus = 1.0
critical_stretch = {stretch}
[[body]]
name = "body"
material = "solid"
{body}
[[region]]
name = "right"
{right}
[[region]]
name = "left"
shape = "box"
lower = {lower}
upper = {left}
[[initial]]
region = "right"
velocity = {velocity}
[[load]]
region = "left"
type = "displacement"
value = {held}
[time]
end = 12.0
[output]
pictures = false
"""
"""A body in [0, n] along each axis, spacing and E 1, held at its left end, whose right end leaves with a fiftieth of the speed of sound."""

GROUP = 'shape = "group"\ngroup = "right"'


def cracked(counts, body=None, right=None, stretch=0.006):
    """Return the text of CRACKED with counts cells along each axis; body, right : lines of the body and of the region "right", boxes by default."""
    dim = len(counts)
    box = 'shape = "box"\nlower = {}\nupper = {}'.format
    upper = [float(n) for n in counts]
    return CRACKED.format(
        dimension="plane_stress" if dim == 2 else "3d", horizon=3.0 if dim == 2 else 2.0, stretch=stretch, lower=[0.0] * dim, left=[1.0] + upper[1:],
        body=body or box([0.0] * dim, upper), right=right or box([upper[0] - 2] + [0.0] * (dim - 1), upper), velocity=[0.02] + [0.0] * (dim - 1), held=[0.0] * dim)


def write_table(path, text):
    """Write the particles of a scene's first body as a table, numbers to the last bit: block 2 in the two layers at its right end, else 1."""
    body = make_body(parse_scene(text, "verification scene"))
    dim = len(body.lattices[0].cells)
    _, points = body.lattices[0].points_in(np.full(dim, -np.inf), np.full(dim, np.inf))
    right = points[:, 0] > points[:, 0].max() - 1.5
    rows = [" ".join([*map(repr, place), repr(body.cell_volume), str(1 + int(end))]) for place, end in zip(points.tolist(), right)]
    Path(path).write_text("# x y z volume block\n" + "\n".join(rows) + "\n")


def write_cells(path, counts):
    """Write the cells of side 1 that fill [0, n] along each axis, in the order of the lattice's ids, with the group "right" of the two last layers."""
    import meshio

    number = np.arange(np.prod([n + 1 for n in counts])).reshape([n + 1 for n in counts])
    points = np.stack(np.meshgrid(*[np.arange(n + 1.0) for n in counts], indexing="ij"), axis=-1).reshape(-1, len(counts))
    square = [(slice(None, -1), slice(None, -1)), (slice(1, None), slice(None, -1)), (slice(1, None), slice(1, None)), (slice(None, -1), slice(1, None))]
    corners = square if len(counts) == 2 else [(*each, depth) for depth in (slice(None, -1), slice(1, None)) for each in square]
    cells = np.stack([number[each].ravel() for each in corners], axis=1)
    right = np.flatnonzero(points[cells].mean(axis=1)[:, 0] > counts[0] - 2)
    points = np.hstack([points, np.zeros((len(points), 3 - len(counts)))])
    kind = "quad" if len(counts) == 2 else "hexahedron"
    meshio.Mesh(points, [(kind, cells)], cell_sets={"right": [right]}).write(path)


def _run(text):
    """Return (displacements (n, dim), broken directed bonds) of a scene at its end."""
    problem = problem_of(text)
    stepper = problem.stepper()
    for _ in range(problem.n_steps):
        stepper.advance()
    particles = problem.subdomain.particles
    return particles.owned(particles.displacement), stepper.view.broken()


def _compared(what, counts, body, group, tolerance):
    """Return Checks of a body from a file against the lattice that it coincides with."""
    expected, broken = _run(cracked(counts))
    with tempfile.TemporaryDirectory(prefix=f"pdhpc_{world().rank}_") as folder:
        path = Path(folder) / ("points.txt" if body == "table" else "cells.inp")
        write_table(path, cracked(counts)) if body == "table" else write_cells(path, counts)
        found, also = _run(cracked(counts, f'shape = "{body}"\nfile = "{path}"', f'shape = "group"\ngroup = "{group}"'))
    difference = float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))
    return [at_most(f"{what}: largest difference of displacements over the largest displacement", difference, tolerance, "the same particles"),
            Check(f"{what}: broken bonds", also, broken, 0, "the same particles, on the lattice"),
            Check(f"{what}: bonds do break", float(broken > 50), 1.0, 0, "the case would say nothing else", relative=False)]


@case
def mesh_and_lattice():
    """particles of quads and hexahedra that coincide with a lattice move and break as the lattice's do"""
    return _compared("24 x 12 quads", (24, 12), "mesh", "right", 1e-10) + _compared("10 x 6 x 5 hexahedra", (10, 6, 5), "mesh", "right", 1e-10)


@case
def table_and_lattice():
    """a table of a lattice's points gives every displacement to the last bit, breaking bonds included"""
    return _compared("24 x 12 points", (24, 12), "table", "2", 0.0) + _compared("10 x 6 x 5 points", (10, 6, 5), "table", "2", 0.0)
