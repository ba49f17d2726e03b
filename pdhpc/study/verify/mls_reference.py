"""What cases of moving least squares are made of: cracked bodies, exact fields, and the formulas in dense matrices with weights that see across cracks."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.family import end_of_bonds, first_bond, is_alive, neighbour
from pdhpc.mls.basis import Basis
from pdhpc.mls.reconstruct import MovingLeastSquares
from pdhpc.scene.body import radius_of
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate, problem_of

PATHS = ("lattice", "cloud")
BOX = {2: (24, 16), 3: (10, 10, 9)}
THROUGH_CRACK = {  # cracks through the whole body, halfway between two layers of particles
    2: '[[crack]]\ntype = "polyline"\npoints = [[-100.0, 0.0], [100.0, 0.0]]\n',
    3: '[[crack]]\ntype = "rectangle"\ncorner = [-100.0, 0.0, -100.0]\nedge1 = [200.0, 0.0, 0.0]\nedge2 = [0.0, 0.0, 200.0]\n',
}


def body_of(dim, path="lattice", cells=None, spacing=1.0, extra="", comm=None):
    """Return the Problem of a box of horizon 3.015 spacings, on this process alone or on the ranks of `comm`."""
    text = plate(cells or BOX[dim], 3.015, spacing, extra=extra, dimension="plane_stress" if dim == 2 else "3d")
    overrides = [f"particles.path={path}", f"time.dt={1e-3 * spacing!r}"]
    return problem_of(text, overrides) if comm is None else build(parse_scene(text, "verification scene", overrides), comm)


def squares_of(problem, degree=1, radius=2.0):
    """Return the MovingLeastSquares of a problem's particles."""
    scene = problem.scene
    return MovingLeastSquares(problem.subdomain, scene.particles.spacing, radius_of(scene), Basis(scene.dim, degree, radius))


def by_slot(subdomain, values):
    """Return values (n_owned, width) as a field by slot; NaN where no particle is, which nothing must read."""
    field = np.full((len(subdomain.points.position), values.shape[1]), np.nan)
    subdomain.particles.put(field, values)
    return field


def rebuild(problem, field, points, degree=1, radius=2.0):
    """Return the Reconstruction at points of a function of place, known at the particles of a problem."""
    squares = squares_of(problem, degree, radius)
    return squares.reconstruct(points, squares.nearest(points), by_slot(problem.subdomain, field(problem.subdomain.places())))


def random_points(problem, n, seed=0):
    """Return (n, dim) points anywhere in the body."""
    body = problem.scene.body[0]
    return np.random.default_rng(seed).uniform(body.lower, body.upper, (n, problem.scene.dim))


@kernel
def _mark_intact(bonds, slots, row_of, intact):
    """Set intact (n, n), by owned row, of the intact bonds of the particles in slots (n,)."""
    for n in range(len(slots)):
        for k in range(first_bond(bonds, slots[n]), end_of_bonds(bonds, slots[n])):
            if is_alive(bonds, slots[n], k):
                intact[n, row_of[neighbour(bonds, slots[n], k)]] = True


def dense_squares(problem, field, points, cut_off):
    """Return (value (n, width), gradient (n, width, dim)) of degree 1 by dense matrices: the formulas, whatever they cost.

    cut_off, the w of W_i = W0 prod over j with A_ij = 0 of (1 - w_ji): "voronoi" 1 in the cell of x_j, "hat" max(0, 1 - |x - x_j| / h), "none" 0.
    """
    subdomain, h = problem.subdomain, problem.scene.particles.spacing
    x, n = subdomain.places(), subdomain.particles.n_owned
    row_of, intact = np.zeros(len(subdomain.points.position), np.int64), np.eye(n, dtype=bool)
    row_of[subdomain.particles.slots] = np.arange(n)
    _mark_intact(subdomain.bonds.arrays, subdomain.particles.slots, row_of, intact)
    offset = (x[None] - points[:, None]) / h
    r = np.linalg.norm(offset, axis=2)
    weight = np.maximum(0.0, 1.0 - (r / 2.0) ** 2) ** 2
    order = np.argsort(r, axis=1)[:, :9]  # no more than eight particles of a lattice lie within h
    for column in order.T if cut_off == "hat" else order.T[:1] if cut_off == "voronoi" else []:
        share = 1.0 if cut_off == "voronoi" else np.maximum(0.0, 1.0 - np.take_along_axis(r, column[:, None], 1))
        weight *= 1.0 - share * ~intact[column]
    p = np.concatenate([np.ones_like(r)[..., None], offset], axis=2)
    moments = np.einsum("pn,pns,pnt->pst", weight, p, p, optimize=True)
    right = np.einsum("pn,pns,nc->psc", weight, p, field(x), optimize=True)
    fit = np.linalg.pinv(moments, rcond=1e-9, hermitian=True) @ right
    return fit[:, 0], np.swapaxes(fit[:, 1:], 1, 2) / h


def polynomial(dim, degree, seed=1):
    """Return (function of places -> (n, dim), its gradient -> (n, dim, dim)) of a random polynomial of degree 1 or 2."""
    random = np.random.default_rng(seed)
    constant, linear, square = random.standard_normal(dim), random.standard_normal((dim, dim)), random.standard_normal((dim, dim, dim)) * (degree > 1)
    square = square + np.swapaxes(square, 1, 2)
    return (
        lambda x: constant + x @ linear.T + 0.5 * np.einsum("cab,na,nb->nc", square, x, x),
        lambda x: linear + np.einsum("cab,nb->nca", square, x),
    )


def jump(dim):
    """Return a function of places: one linear field where y < 0, another elsewhere."""
    below, above = polynomial(dim, 1, 2)[0], polynomial(dim, 1, 3)[0]
    return lambda x: np.where(x[:, 1:2] < 0.0, below(x), above(x))


def relative(found, exact, chosen=slice(None)):
    """Return the root of the mean square of an error over that of the field, at chosen points."""
    return float(np.sqrt(np.sum((found[chosen] - exact[chosen]) ** 2) / np.sum(exact[chosen] ** 2)))


TIP = 0.1


def williams(x):
    """Return the displacement (n, dim) of a mode I crack along y = 0, x < TIP, of a plate in plane stress, nu = 1/3 (Williams 1957); w = 0 in 3D."""
    r, theta = np.hypot(x[:, 0] - TIP, x[:, 1]), np.arctan2(x[:, 1], x[:, 0] - TIP)
    radial = 0.1 * np.sqrt(r) * ((3 - 1 / 3) / (1 + 1 / 3) - np.cos(theta))
    return np.stack([radial * np.cos(theta / 2), radial * np.sin(theta / 2), 0.0 * r][: x.shape[1]], axis=1)


def differences(field, x, step=1e-6):
    """Return the gradient (n, width, dim) of a function of places by central differences."""
    moves = step * np.eye(x.shape[1])
    return np.stack([(field(x + move) - field(x - move)) / (2 * step) for move in moves], axis=2)


def williams_body(dim, path="lattice", cracked=True):
    """Return the Problem of a cracked unit square of 40 by 40 particles, in 3D 6 particles thick."""
    h = 1 / 40
    crack = {
        2: f'[[crack]]\ntype = "polyline"\npoints = [[-1.0, 0.0], [{TIP}, 0.0]]\n',
        3: f'[[crack]]\ntype = "rectangle"\ncorner = [-1.0, 0.0, -1.0]\nedge1 = [{1.0 + TIP}, 0.0, 0.0]\nedge2 = [0.0, 0.0, 2.0]\n',
    }
    return body_of(dim, path, (40, 40) if dim == 2 else (40, 40, 6), h, crack[dim] if cracked else "")


def near_crack(dim, per_particle=8):
    """Return (n, dim) points on a grid of `per_particle` per spacing: less than 2.5 spacings from the crack, 3 or more behind its tip."""
    h = 1 / 40
    steps = (np.arange(40 * per_particle) + 0.5) / (40 * per_particle) - 0.5
    along, across = steps[steps < TIP - 3 * h], steps[np.abs(steps) < 2.5 * h]
    grid = np.meshgrid(along, across, *[np.linspace(-2.9 * h, 2.9 * h, 7)] * (dim - 2), indexing="ij")
    return np.stack([each.ravel() for each in grid], axis=1)
