"""Energies and forces of homogeneous deformations."""
import itertools
import math

import numpy as np

from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.study.verify.case import Check, at_most, case, plate, problem_of

GRADIENT = {2: np.array([[0.010, 0.004], [-0.002, -0.006]]), 3: np.array([[0.010, 0.004, 0.001], [-0.002, -0.006, 0.003], [0.002, -0.001, 0.005]])}


def lattice_vectors(dim, ratio):
    """Return the bond vectors of an interior particle of a lattice of spacing 1, by brute force."""
    reach = range(-int(ratio) - 1, int(ratio) + 2)
    return np.array([xi for xi in itertools.product(reach, repeat=dim) if 0 < sum(x * x for x in xi) < (ratio + 0.5) ** 2], dtype=float)


def _discrete_energy(dimension, ratio, gradient, finite):
    """Return the strain energy density of an interior particle from the lattice sum 1/2 sum c beta s^2 r / 2, E = 1, spacing 1, thickness 1."""
    dim = len(gradient)
    xi = lattice_vectors(dim, ratio)
    r = np.linalg.norm(xi, axis=1)
    moved = xi + xi @ gradient.T
    stretch = np.linalg.norm(moved, axis=1) / r - 1 if finite else np.einsum("nd,nd->n", xi, xi @ gradient.T) / r**2
    micromodulus = {"plane_stress": 9 / (math.pi * ratio**3), "plane_strain": 48 / (5 * math.pi * ratio**3), "3d": 12 / (math.pi * ratio**4)}[dimension]
    beta = np.minimum(1.0, ratio + 0.5 - r)
    return 0.25 * float(np.sum(micromodulus * beta * stretch**2 * r))


def _continuum_energy(dimension, gradient):
    """Return the energy density of linear elasticity, E = 1, at the Poisson's ratio of the bond-based model."""
    nu = {"plane_stress": 1 / 3, "plane_strain": 1 / 4, "3d": 1 / 4}[dimension]
    strain = 0.5 * (gradient + gradient.T)
    shear = 1 / (2 * (1 + nu))
    lame = nu / ((1 + nu) * (1 - 2 * nu)) if dimension != "plane_stress" else nu / (1 - nu**2)
    return 0.5 * lame * np.trace(strain) ** 2 + shear * float(np.sum(strain**2))


def _centre_energy(dimension, ratio, gradient, kinematics):
    """Return the energy density of the particle at the centre of a deformed body, as the program computes it."""
    dim = len(gradient)
    cells = 2 * int(ratio) + 5
    problem = problem_of(plate((cells,) * dim, ratio, 1.0, kinematics, dimension=dimension))
    particles, places = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, places @ gradient.T)
    particles.place()
    centre = int(np.argmin(np.linalg.norm(places, axis=1)))
    return strain_energy_density(problem.subdomain, problem.body.law)[centre]


@case
def affine_energy():
    """strain energy of an interior particle under affine deformation equals the lattice sum, 2D and 3D, linear and finite"""
    checks = []
    for dimension, kinematics in itertools.product(("plane_stress", "plane_strain", "3d"), ("linear", "finite")):
        dim = 3 if dimension == "3d" else 2
        gradient = 10 * GRADIENT[dim]  # large, so that finite and linear differ
        expected = _discrete_energy(dimension, 3.0, gradient, kinematics == "finite")
        measured = _centre_energy(dimension, 3.0, gradient, kinematics)
        checks.append(Check(f"{dimension}, {kinematics}", measured, expected, 1e-12, "lattice sum (brute force)"))
    return checks


@case
def affine_energy_converges():
    """strain energy density approaches linear elasticity as horizon/spacing grows"""
    checks = []
    for dimension, ratios in (("plane_stress", (3, 6, 12)), ("plane_strain", (3, 6, 12)), ("3d", (3, 5, 7))):
        gradient = GRADIENT[3 if dimension == "3d" else 2]
        expected = _continuum_energy(dimension, gradient)
        errors = [abs(_centre_energy(dimension, float(ratio), gradient, "linear") / expected - 1) for ratio in ratios]
        checks.append(at_most(f"{dimension}: relative error at horizon/spacing {ratios[-1]}", errors[-1], 0.01 if dimension != "3d" else 0.03, "Hooke's law"))
        checks.append(Check(f"{dimension}: error shrinks from {ratios[0]} to {ratios[-1]}", float(errors[-1] < errors[0]), 1.0, 0.0, "Hooke's law"))
    return checks


@case
def rigid_rotation():
    """a rigid rotation exerts no force (finite kinematics)"""
    checks = []
    for dim, dimension in ((2, "plane_stress"), (3, "3d")):
        problem = problem_of(plate((9,) * dim, 3.0, 1.0, "finite", dimension=dimension))
        particles = problem.subdomain.particles
        angle = math.radians(40)
        rotation = np.eye(dim)
        rotation[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        particles.put(particles.displacement, problem.subdomain.places() @ (rotation - np.eye(dim)).T)
        stepper = problem.stepper()
        force = np.abs(stepper.subdomain.particles.force_density).max()
        unit = problem.body.law.micromodulus[0, 0] * problem.body.cell_volume * problem.subdomain.bonds.family_size.max()
        checks.append(at_most(f"{dim}D, 40 degrees: largest force over c V N", force / unit, 1e-12, "objectivity"))
    return checks
