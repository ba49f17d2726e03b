"""Modified moving least squares against fields it must reproduce, and against weights that see across cracks."""
import itertools

import numpy as np

from pdhpc.parallel.comm import world
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.mls_reference import (
    BOX, PATHS, THROUGH_CRACK, body_of, by_slot, dense_squares, differences, jump, near_crack, polynomial, random_points, rebuild, relative, squares_of,
    williams, williams_body,
)

_SOURCE = "least squares reproduce their polynomials"
_SLANTED = '[[crack]]\ntype = "polyline"\npoints = [[-100.0, -37.3], [100.0, 41.7]]\n'


@case
def mls_polynomials():
    """Linear fields, and at degree 2 quadratic ones, are rebuilt exactly with their gradients, 2D and 3D, on both storages"""
    checks = []
    for dim, path, degree in itertools.product((2, 3), PATHS, (1, 2)):
        problem = body_of(dim, path)
        points = random_points(problem, 5000)
        field, gradient = polynomial(dim, degree)
        found = rebuild(problem, field, points, degree, 2.5)
        whole = found.degree == degree
        inside = (np.abs(points) < np.array(BOX[dim]) / 2 - 1.0).all(axis=1)
        name = f"{dim}D, {path}, degree {degree}"
        checks.append(at_most(f"{name}: value", relative(found.value, field(points), whole), 1e-10, _SOURCE))
        checks.append(at_most(f"{name}: gradient", relative(found.gradient, gradient(points), whole), 1e-10, _SOURCE))
        fell_back = 1.0 - whole[inside].mean()
        checks.append(at_most(f"{name}: share of points a spacing or more inside that fell back", fell_back, 0.0, "families that bear the degree"))
    return checks


@case
def mls_jump():
    """A piecewise linear field is rebuilt exactly on both sides of a through crack; weights that fade with distance are not"""
    checks = []
    for dim, path in itertools.product((2, 3), PATHS):
        problem, field, name = body_of(dim, path, extra=THROUGH_CRACK[dim]), jump(dim), f"{dim}D, {path}"
        points = random_points(problem, 3000 if dim == 2 else 1000)
        found = rebuild(problem, field, points)
        exact = field(points)
        scale = np.abs(exact).max()
        checks.append(at_most(f"{name}: largest error", np.abs(found.value - exact).max() / scale, 1e-10, _SOURCE))
        slope = np.where((points[:, 1] < 0.0)[:, None, None], polynomial(dim, 1, 2)[1](points), polynomial(dim, 1, 3)[1](points))
        checks.append(at_most(f"{name}: largest error of the gradient", np.abs(found.gradient - slope).max() / np.abs(slope).max(), 1e-10, _SOURCE))
        hat = np.abs(dense_squares(problem, field, points, "hat")[0] - exact).max() / scale
        checks.append(Check(f"{name}: control, hat weight: largest error {hat:.3f} exceeds 0.1", float(hat > 0.1), 1.0, 0.0, "leak between the faces"))
    return checks + _slanted()


def _slanted():
    """Return the check of a slanted through crack, where a point is on the side of its nearest particle."""
    problem = body_of(2, extra=_SLANTED)
    points, squares = random_points(problem, 3000), squares_of(problem)
    near = squares.nearest(points)
    normal = np.array([-79.0, 200.0])
    fields = [polynomial(2, 1, seed)[0] for seed in (2, 3)]
    x = problem.subdomain.places()
    sides = [((each - [-100.0, -37.3]) @ normal < 0.0)[:, None] for each in (x, problem.subdomain.places_at(near))]
    found = squares.reconstruct(points, near, by_slot(problem.subdomain, np.where(sides[0], fields[0](x), fields[1](x))))
    exact = np.where(sides[1], fields[0](points), fields[1](points))
    error = np.abs(found.value - exact).max() / np.abs(exact).max()
    return [at_most("slanted crack, side of the nearest particle: largest error", error, 1e-10, _SOURCE)]


@case
def mls_williams():
    """The field of a mode I crack is rebuilt near the crack; unmodified least squares, and weights that fade with distance, smear it"""
    checks, source = [], "Williams 1957"
    for dim, path in ((2, "lattice"), (2, "cloud"), (3, "lattice"), (3, "cloud")):
        points = near_crack(dim, 8 if dim == 2 else 4)
        value, gradient = williams(points), differences(williams, points)
        problem = williams_body(dim, path)
        found = rebuild(problem, williams, points)
        name = f"{dim}D, {path}"
        checks.append(at_most(f"{name}: value within 2.5 spacings of the crack", relative(found.value, value), 0.005, source))
        checks.append(at_most(f"{name}: gradient", relative(found.gradient, gradient), 0.05, source))
        plain = rebuild(williams_body(dim, path, cracked=False), williams, points)
        error, steep = relative(plain.value, value), relative(plain.gradient, gradient)
        words = f"{name}: control, unmodified: value {error:.3f}, gradient {steep:.2f}, exceed 0.2"
        checks.append(Check(words, float(min(error, steep) > 0.2), 1.0, 0.0, source))
    points = near_crack(2, 3)
    hat = relative(dense_squares(williams_body(2), williams, points, "hat")[0], williams(points))
    checks.append(Check(f"2D: control, hat weight: value {hat:.3f} exceeds 0.2", float(hat > 0.2), 1.0, 0.0, source))
    return checks


@case
def mls_damage():
    """Under random damage the degree falls back, what has a degree stays exact, and nothing is ever undefined"""
    checks = []
    for dim, path, degree in itertools.product((2, 3), PATHS, (1, 2)):
        field, gradient = polynomial(dim, 1)
        used, worst = np.zeros(3, int), 0.0
        for share in (0.5, 0.8, 0.9, 0.95, 1.0):
            problem = body_of(dim, path)
            _break_at_random(problem.subdomain.bonds.arrays.alive, share)
            points = random_points(problem, 3000)
            found = rebuild(problem, field, points, degree)
            fitted = found.degree >= 1
            worst = max(worst, np.abs(found.value - field(points))[fitted].max(initial=0.0), np.abs(found.gradient - gradient(points))[fitted].max(initial=0.0))
            worst = worst if np.isfinite(found.value).all() and np.isfinite(found.gradient).all() and (found.degree >= 0).all() else np.nan
            used += np.bincount(found.degree, minlength=3)
        name = f"{dim}D, {path}, degree {degree}"
        checks.append(at_most(f"{name}: value and gradient of a linear field, and NaN if anything is", worst, 1e-9, _SOURCE))
        mixed, words = bool((used[: degree + 1] > 100).all()), f"{name}: points of degree 0, 1, 2: {', '.join(map(str, used))}, all that may occur do"
        checks.append(Check(words, float(mixed), 1.0, 0.0, "a case that tests something"))
        least = _means_of_their_particles(problem, field, degree)
        checks.append(at_most(f"{name}: all bonds broken: value less that of the nearest particle, and gradient", least, 1e-12, "a particle sees itself"))
    return checks


def _break_at_random(alive, share):
    """Clear each bit of an array of bond states with a probability; the two ends of a bond apart, since a point asks one of them only."""
    random, bits = np.random.default_rng(5), 8 * alive.itemsize
    kept = random.random(alive.shape + (bits,)) >= share
    alive &= np.packbits(kept, axis=-1, bitorder="little").view(alive.dtype)[..., 0]


def _means_of_their_particles(problem, field, degree):
    """Return the largest value less the nearest particle's, and gradient, of a body without bonds."""
    points, squares = random_points(problem, 3000), squares_of(problem, degree)
    near = squares.nearest(points)
    found = squares.reconstruct(points, near, by_slot(problem.subdomain, field(problem.subdomain.places())))
    return max(np.abs(found.value - field(problem.subdomain.places_at(near))).max(), np.abs(found.gradient).max())


@case
def mls_quadrature():
    """Mass and gradient blocks of a cracked cell of five particles per side come out by one point per particle"""
    problem, source = williams_body(2), "8 x 8 x 4 points per particle"
    squares, values = squares_of(problem), by_slot(problem.subdomain, williams(problem.subdomain.places()))
    h, checks = 1 / 40, []
    for count, bound in ((5, 0.03), (10, 0.01)):
        corner, side = np.array([-0.25, -(count // 2) * h]), count * h
        exact = _blocks(squares, values, corner, side, 8 * count, 2)
        for name, pieces, points, limit in (("one point", count, 1, bound), ("2 x 2 points", count, 2, 1e-3)):
            for block, error in zip(("mass", "gradient"), _errors(_blocks(squares, values, corner, side, pieces, points), exact)):
                checks.append(at_most(f"H/h = {count}: {block} block, {name} per particle", error, limit, source))
    errors = _errors(_blocks(squares, values, np.array([-0.25, -2 * h]), 5 * h, 1, 4), _blocks(squares, values, np.array([-0.25, -2 * h]), 5 * h, 40, 2))
    checks.append(Check(f"control, 4 x 4 Gauss points in the whole cell: {min(errors):.3f} exceeds 0.03", float(min(errors) > 0.03), 1.0, 0.0, source))
    return checks


def _blocks(squares, values, corner, side, pieces, gauss):
    """Return (mass, gradient) blocks (8, 8) of {phi_a, phi_a eta_y} on a square cell by `gauss` squared points in each of `pieces` squared parts."""
    place, weight = np.polynomial.legendre.leggauss(gauss)
    t = ((np.arange(pieces)[:, None] + (place + 1) / 2) / pieces).ravel()
    weight = np.tile(weight / (2 * pieces), pieces)
    x, y = (each.ravel() for each in np.meshgrid(t, t))
    weight = np.outer(weight, weight).ravel() * side**2
    points = corner + side * np.stack([x, y], axis=1)
    found = squares.reconstruct(points, squares.nearest(points), values)
    eta, slope = found.value[:, 1:], found.gradient[:, 1]
    phi = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y], axis=1)
    along = np.stack([-(1 - y), 1 - y, -y, y], axis=1) / side, np.stack([-(1 - x), -x, 1 - x, x], axis=1) / side
    functions = np.hstack([phi, phi * eta])
    mass = functions.T @ (functions * weight[:, None])
    stiffness = sum(
        each.T @ (each * weight[:, None]) for each in (np.hstack([d, d * eta + phi * slope[:, axis, None]]) for axis, d in enumerate(along))
    )
    return mass, stiffness


def _errors(found, exact):
    return [float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in zip(found, exact)]


@case
def mls_order():
    """Values and gradients of a smooth field converge at order degree + 1 and degree beside the surface, and no slower inside"""
    checks = []
    for dim, degree in itertools.product((2, 3), (1, 2)):
        counts = (20, 40, 80) if dim == 2 else (10, 20, 40)
        errors = np.array([_errors_of_a_wave(dim, degree, n) for n in counts])
        observed = np.log2(errors[-2] / errors[-1])
        for column, (name, order) in enumerate((("value", degree + 1), ("gradient", degree))):
            head = f"{dim}D, degree {degree}: order of the {name} at {counts[-1]} particles per side"
            checks.append(Check(f"{head}, beside the surface", observed[0, column], order, 0.2, "Taylor", relative=False))
            inside = observed[1, column]
            checks.append(Check(f"{head}, inside: {inside:.2f}, at least {order - 0.2:.1f}", float(inside > order - 0.2), 1.0, 0.0, "Taylor; symmetry adds"))
    return checks


def _errors_of_a_wave(dim, degree, n):
    """Return ((value, gradient) beside the surface, (value, gradient) inside), errors on a unit cube of n particles per side, where the degree is borne."""
    waves = np.array([[2.0, 3.0, 1.0], [1.0, -2.0, 2.0]])[:, :dim]
    points, found = np.random.default_rng(4).uniform(-0.5, 0.5, (2, 3000, dim)), []
    points[0, :, 0] = 0.5 + (points[0, :, 0] - 0.5) * 0.5 / n
    points[0, :, 1:] *= 1.0 - 6.0 / n
    points[1] *= 1.0 - 6.0 / n
    problem = body_of(dim, cells=(n,) * dim, spacing=1 / n)
    for each in points:
        result, phase = rebuild(problem, lambda x: np.sin(x @ waves.T + 0.3), each, degree, 2.5), each @ waves.T + 0.3
        borne = result.degree == degree
        found.append((relative(result.value, np.sin(phase), borne), relative(result.gradient, np.cos(phase)[:, :, None] * waves, borne)))
    return found


@case
def mls_ranks():
    """Every point is one rank's, and what is rebuilt there has the bits that it has on one rank"""
    checks, comm = [], world()
    for dim, path in itertools.product((2, 3), PATHS):
        results = []
        for problem in (body_of(dim, path, extra=THROUGH_CRACK[dim]), body_of(dim, path, extra=THROUGH_CRACK[dim], comm=comm)):
            squares, values = squares_of(problem), by_slot(problem.subdomain, jump(dim)(problem.subdomain.places()) ** 3)
            problem.exchange.bind(values).refresh()
            points = random_points(problem, 3000)
            results.append(squares.reconstruct(points, squares.nearest(points), values))
        alone, shared = results
        different = sum(int(np.sum(comm.allreduce(found) != whole)) for found, whole in zip(shared[:2], alone[:2]))
        checks.append(Check(f"{dim}D, {path}: numbers that differ from 1 rank", different, 0.0, 0.0, "bitwise equality"))
        holders = comm.allreduce((shared.degree >= 0).astype(int))
        checks.append(Check(f"{dim}D, {path}: points that are not one rank's", int(np.sum(holders != 1)), 0.0, 0.0, "a partition of the body"))
    return checks
