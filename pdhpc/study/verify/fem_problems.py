"""Meshes, manufactured solutions and set-ups that the cases of finite elements share."""
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from pdhpc.conditions.time_functions import Constant
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.elasticity import Elasticity
from pdhpc.fem.facets import UNIT_CORNERS
from pdhpc.fem.loads import body_loads, nodal_load
from pdhpc.fem.mesh import Mesh, cell_partition, make_box_mesh
from pdhpc.fem.mesh_file import FileMesh
from pdhpc.fem.migrate import migrate
from pdhpc.fem.moduli import isotropic
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.static import Static
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.parallel.noise import noise

DIMENSION = {2: "plane_stress", 3: "3d"}
UPPER = (1.0, 1.2, 0.8)


def box_mesh(comm, counts, upper=UPPER, keep=None):
    """Return the Mesh of a box from 0 to `upper` (as many axes as counts has). Collective."""
    dim = len(counts)
    box = [0.0] * dim, list(upper[:dim]), counts
    return make_box_mesh(comm, *box, cell_partition(comm, *box), keep)


def general_mesh(comm, kind, counts, distortion=0.0, upper=UPPER):
    """Return a Mesh of any kind as from a file: a box of cells, cut into simplices or not, inner vertices moved by up to `distortion` of a cell. Collective."""
    dim = len(counts)
    shape = np.array(counts) + 1
    index = np.stack([each.ravel() for each in np.meshgrid(*map(np.arange, shape), indexing="ij")], axis=1)
    step = np.array(upper[:dim]) / counts
    inner = ((index > 0) & (index < counts)).all(axis=1)
    points = step * (index + distortion * inner[:, None] * noise(np.arange(len(index)), dim, 1))
    lowest = index[(index < counts).all(axis=1)]
    cells = np.concatenate([np.ravel_multi_index((lowest[:, None, :] + corners).transpose(2, 0, 1), shape) for corners in _cuts(kind, dim)])
    whole = FileMesh(kind, points, np.arange(len(points)), cells.astype(np.int32), {}, {})
    return Mesh(comm, *migrate(comm, whole if comm.rank == 0 else None))


def _cuts(kind, dim):
    """Return [(corners, dim)]: the cells that a box is cut into."""
    if kind in ("quad", "hexahedron"):
        return [UNIT_CORNERS[kind]]
    cuts = []
    for order in permutations(range(dim)):  # Kuhn's simplices: from the lowest to the highest corner along the axes in this order
        path = np.cumsum(np.vstack([np.zeros(dim, int)] + [np.eye(dim, dtype=int)[axis] for axis in order]), axis=0)
        turned = np.linalg.det(path[1:] - path[0]) < 0
        cuts.append(path[[0, 2, 1, *range(3, dim + 1)]] if turned else path)
    return cuts


class Exact(NamedTuple):
    """A displacement field: functions of points (n, dim). displacement (n, dim), m; gradient (n, dim, dim); force: -div sigma (n, dim), N/m^3."""

    displacement: object
    gradient: object
    force: object


def linear_field(dim):
    """Return the Exact of a field with constant gradient."""
    gradient = np.array([[0.3, -0.2, 0.1], [0.4, 0.1, -0.3], [-0.1, 0.2, 0.5]])[:dim, :dim]
    shift = np.array([0.1, -0.2, 0.3])[:dim]
    return Exact(lambda x: x @ gradient.T + shift, lambda x: np.tile(gradient, (len(x), 1, 1)), lambda x: np.zeros(x.shape))


def waves(tensor):
    """Return the Exact u_a = prod_c sin(k_c x_c + p_a), with the body force that the moduli (dim, dim, dim, dim), Pa, need for it."""
    dim = len(tensor)
    k, phase = np.array([2.0, 1.5, 1.8])[:dim], np.array([0.3, 0.9, 0.5])[:dim]

    def derivative(x, a, *axes):
        angle = x * k + phase[a] + 0.5 * np.pi * np.array([axes.count(axis) for axis in range(dim)])  # sin' = sin(. + pi/2)
        return np.prod(np.sin(angle), axis=1) * np.prod(k[list(axes)])

    def displacement(x):
        return np.stack([derivative(x, a) for a in range(dim)], axis=1)

    def gradient(x):
        return np.stack([np.stack([derivative(x, a, b) for b in range(dim)], axis=1) for a in range(dim)], axis=1)

    def force(x):
        second = {(b, c, d): derivative(x, b, c, d) for b, c, d in product(range(dim), repeat=3)}
        return np.stack([-sum(tensor[a, c, b, d] * second[b, c, d] for b, c, d in second) for a in range(dim)], axis=1)

    return Exact(displacement, gradient, force)


def solid(mesh, poissons_ratio=0.3, **more):
    """Return an Elasticity with E = 1, density 1."""
    return Elasticity(mesh, isotropic(1.0, poissons_ratio, DIMENSION[mesh.dim]), 1.0, **more)


def solve_with(body, exact):
    """Return the solved Static of a body whose whole surface moves as `exact`. Collective."""
    nodes = Nodes(body.mesh, False, body.width)
    motions = prescribe_on_facets(body, nodes, body.mesh.boundary()[0], range(body.mesh.dim), Given(exact.displacement, Constant(), exact.gradient))
    load = nodal_load(nodes, body_loads(body, nodes.stars, exact.force), Constant())
    problem = Static(body, nodes, NodalConditions(nodes, [load], motions))
    problem.advance()
    return problem
