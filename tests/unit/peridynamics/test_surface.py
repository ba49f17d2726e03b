import numpy as np
import pytest

from pdhpc.kernels.family import MIXED, VARIED
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.fields import field, strain_energy_density
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.surface import METHODS, REPEATS, bulk_energies, correct_surfaces, whole_family
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import NoGhosts


def body(method, cells=(24, 20), dimension="plane_stress", extra=""):
    problem = problem_of(plate(cells, 3.0, dimension=dimension, extra=extra), [f"particles.surface_correction={method}", "particles.path=cloud"])
    return problem, problem.subdomain, problem.subdomain.places()


def energies(problem, gradient):
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, x @ gradient)
    particles.place()
    return strain_energy_density(problem.subdomain, problem.body.law)


@pytest.mark.parametrize("dimension, hooke", [("plane_stress", 9 / 16), ("plane_strain", 3 / 5), ("3d", 3 / 5)])
def test_the_bulk_by_hookes_law_and_whole_families(dimension, hooke):
    solid, setting = BondBased("a", 7.0, 2.0), Setting(dimension, 3.0, 0.5, "conical")
    assert bulk_energies([(solid, True)], setting)[0] == pytest.approx(2.0 * hooke, rel=1e-12), "0.6 E and 9/16 E (Madenci & Oterkus 2014)"
    assert whole_family(solid, setting) == pytest.approx(36 * np.pi if dimension == "3d" else 4.5 * np.pi)


@pytest.mark.parametrize("dimension, cells", [("plane_stress", (38, 36)), ("3d", (14, 12, 12))])
def test_inside_an_extension_along_an_axis_holds_hookes_energy_by_energy(dimension, cells):
    """Inside all scales are equal; then the factor is that of the axis, on a lattice the same for all axes. Each repeat reaches a family farther in."""
    problem, _, x = body("energy", cells, dimension)
    gradient = np.zeros((len(cells), len(cells)))
    gradient[0, 0] = 1.0
    inner = int(np.argmin(np.linalg.norm(x, axis=1)))
    assert energies(problem, gradient)[inner] == pytest.approx(9 / 16 if dimension == "plane_stress" else 0.6, rel=1e-12 if dimension == "plane_stress" else 0.025), "no inside in 3D here"


def test_surfaces_lose_less_energy_and_the_inside_keeps_its_own():
    spread = np.eye(2)
    plain, _, x = body("none")
    without = energies(plain, spread)
    inside = (np.abs(x) < [4.0, 2.0]).all(axis=1)  # no particle of whose neighbours lacks a part; repeats of the energy method reach there
    for method, left in (("energy", 0.1), ("volume", 0.4)):
        problem, _, _ = body(method)
        found = energies(problem, spread)
        lost = [1 - each.sum() / (len(each) * each[inside].mean()) for each in (without, found)]
        assert 0.1 < lost[0] and abs(lost[1]) < left * lost[0]
        assert np.ptp(found[inside]) < (0.01 if method == "energy" else 1e-12) * found[inside].mean()


def test_repeated_every_particle_of_a_surface_stores_what_the_bulk_does(monkeypatch):
    """Under an extension along each axis; taken once, as published, surfaces are up to a quarter off. A corner has too few bonds for it."""
    off = []
    for repeats in (1, REPEATS):
        monkeypatch.setattr("pdhpc.peridynamics.surface.REPEATS", repeats)
        problem, _, x = body("energy")
        beside = np.minimum(12 - np.abs(x[:, 0]), 10 - np.abs(x[:, 1])) < 3
        corner = (12 - np.abs(x[:, 0]) < 4) & (10 - np.abs(x[:, 1]) < 4)
        found = np.array([energies(problem, np.diag(along)) for along in np.eye(2)]) / (9 / 16)
        off.append(np.sqrt(np.mean((found[:, beside & ~corner] - 1) ** 2)))
    assert 0.08 < off[0] < 0.25 and off[1] < off[0] / 2.5


@pytest.mark.parametrize("method", METHODS)
def test_factors_come_from_the_families_before_cracks_and_count_everywhere(method):
    """Forces derive from energies, the stable step shrinks, and a pre-crack does not change a factor."""
    crack = '[[crack]]\ntype = "polyline"\npoints = [[-13.0, 0.0], [0.0, 0.0]]\n'
    cracked, _, _ = body(method, extra=crack)
    problem, subdomain, x = body(method)
    factor = subdomain.bonds.arrays.factor
    assert np.array_equal(cracked.subdomain.bonds.arrays.factor, factor) and cracked.subdomain.bonds.alive().sum() < subdomain.bonds.alive().sum()
    plain, _, _ = body("none")
    assert stable_step(subdomain, problem.body.law) < 0.99 * stable_step(plain.subdomain, plain.body.law)
    random = np.random.default_rng(0)
    u, v = (1e-3 * random.standard_normal(x.shape) for _ in range(2))
    particles = subdomain.particles

    def energy(t):
        particles.put(particles.displacement, u + t * v)
        particles.place()
        return strain_energy_density(subdomain, problem.body.law).sum()

    slope = (energy(0.5) - energy(-0.5))  # exact for a quadratic
    energy(0.0)
    problem.stepper()
    force = particles.owned(particles.force_density)
    assert np.sum(force * v) == pytest.approx(-slope, rel=1e-10)
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * np.abs(force).sum()
    assert np.all(np.isfinite(field("stress", subdomain, problem.body.law)))


def test_a_row_of_particles_has_no_bonds_along_the_other_axis():
    problem, subdomain, x = body("energy", (40, 1))
    assert np.all(np.isfinite(subdomain.bonds.arrays.factor)) and subdomain.bonds.arrays.factor.min() > 0
    gradient = np.zeros((2, 2))
    gradient[0, 0] = 1.0
    middle = int(np.argmin(np.abs(x[:, 0])))
    assert energies(problem, gradient)[middle] == pytest.approx(9 / 16, rel=1e-12)


def test_ghosts_bring_their_own_scales():
    problem, subdomain, _ = body("none")
    blocks, setting = problem.body.calibration()
    fields = []

    class Ghosts(NoGhosts):
        def __init__(self, field):
            fields.append(field)

    correct_surfaces(subdomain, problem.body.law, blocks, setting, Ghosts, "energy")
    assert fields[0].shape == (len(subdomain.points.position), 2)


@pytest.mark.parametrize("method", METHODS)
def test_rows_of_several_volumes_take_their_factors(method):
    """Eight bonds at a time as bond by bond."""
    problem, subdomain, _ = body(method)
    particles, random = subdomain.particles, np.random.default_rng(4)
    particles.volume[:] = random.uniform(0.5, 1.5, len(particles.volume))
    particles.displacement[:] = random.normal(0, 0.01, particles.displacement.shape)
    particles.place()
    found = []
    for mark in (VARIED, MIXED):
        subdomain.points.row_block[:] = mark
        InternalForces(subdomain, problem.body.law, NoGhosts).evaluate()
        found.append(particles.force_density.copy())
    assert np.ptp(subdomain.bonds.arrays.factor) > 0.1 and np.abs(found[0] - found[1]).max() < 1e-12 * np.abs(found[1]).max()
