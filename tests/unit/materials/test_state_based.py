import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.influence import value
from pdhpc.materials.law import Setting
from pdhpc.materials.state_based import LinearSolid
from pdhpc.peridynamics.fields import field, strain_energy_density
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS

E, RATE, DELTA = 65e9, 204.0, 1e-3
DIMENSIONS = ("plane_stress", "plane_strain", "3d")


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.25, 0.3, 0.49])
def test_moduli_of_young_and_poisson_and_back(nu):
    bulk, shear = LinearSolid.moduli(E, nu)
    assert 9 * bulk * shear / (3 * bulk + shear) == pytest.approx(E, rel=1e-12)
    assert (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)) == pytest.approx(nu, abs=1e-12)


@pytest.mark.parametrize("nu", [0.0, 0.25, 1 / 3, 0.45])
def test_the_bulk_modulus_of_each_dimension(nu):
    solid = LinearSolid("a", 1.0, *LinearSolid.moduli(E, nu))
    expected = {"3d": E / (3 * (1 - 2 * nu)), "plane_strain": E / (2 * (1 + nu) * (1 - 2 * nu)), "plane_stress": E / (2 * (1 - nu))}
    for dimension, bulk in expected.items():  # sigma_xx = sigma_yy = 2 k eps of an isotropic in-plane strain eps, by Hooke's law
        assert solid.bulk(Setting(dimension, DELTA, 1.0, "constant")) == pytest.approx(bulk, rel=1e-12)


@pytest.mark.parametrize("dimension, nu", [("plane_stress", 1 / 3), ("plane_strain", 1 / 4), ("3d", 1 / 4)])
@pytest.mark.parametrize("influence", ["constant", "inverse_distance", "gaussian", "conical"])
def test_at_the_poissons_ratio_of_central_forces_it_is_the_bond_based_solid(dimension, nu, influence):
    """There d k = (d + 2) G: no dilatation enters, and PMB with omega of LPS over r has the same bonds, the same energy and the same cut."""
    setting = Setting(dimension, DELTA, 1.0, influence)
    solid = LinearSolid("a", 1.0, *LinearSolid.moduli(E, nu), energy_release_rate=RATE)
    law, dim = LinearSolid.law([(solid, True)], setting), 3 if dimension == "3d" else 2
    assert dim * solid.bulk(setting) == pytest.approx((dim + 2) * solid.shear_modulus, rel=1e-12)
    assert abs(law.volumetric[0] * law.deviatoric[0] ** 2) < 1e-12 * E and abs(law.spherical[0]) * E < 1e-12 and law.bound[0] == pytest.approx(1.0)
    area = 4 * math.pi if dim == 3 else 2 * math.pi
    whole = area * quad(lambda r: value(influence, np.array(r), DELTA) * r ** (dim + 1), 0, DELTA)[0]
    micromodulus = 2 * law.deviatoric[0] / whole  # t_i + t_j = 2 d (d + 2) G/m omega e against c omega' s: omega' = omega r
    cut = _cut_energy(dim, lambda r: 0.5 * micromodulus * value(influence, np.array(r), DELTA) * r**2)
    assert solid.stretch_limit(setting) == pytest.approx(math.sqrt(RATE / cut), rel=1e-6)


def _cut_energy(dim, micropotential):
    """Energy per area and squared stretch of the bonds that cross a plane, by counting: a bond of length r at an angle to the normal starts r cos below it."""
    if dim == 3:  # sum over directions of the upper half: 2 pi int cos sin = pi
        return quad(lambda r: micropotential(r) * r * math.pi * r**2, 0, DELTA)[0]
    return quad(lambda r: micropotential(r) * r * 2.0 * r, 0, DELTA)[0]  # int cos over the upper half = 2


@pytest.mark.parametrize("dimension, nu", [("plane_stress", 1 / 3), ("plane_strain", 1 / 4), ("3d", 1 / 4)])
def test_critical_stretches_agree_with_the_bond_based_ones(dimension, nu):
    """PMB of constant micromodulus holds c s^2 r/2, LPS with omega = delta/r a constant times e^2/r = s^2 r: the same bonds."""
    setting = Setting(dimension, DELTA, 1.0, "inverse_distance")
    solid = LinearSolid("a", 1.0, *LinearSolid.moduli(E, nu), energy_release_rate=RATE)
    bonds = BondBased("b", 1.0, E, energy_release_rate=RATE)
    limit = solid.stretch_limit(setting)
    assert limit == pytest.approx(bonds.stretch_limit(setting._replace(influence="constant")), rel=1e-10)
    if dimension == "3d":
        assert limit == pytest.approx(math.sqrt(5 * RATE / (9 * solid.bulk_modulus * DELTA)), rel=1e-10)


def test_critical_stretch_is_given_derived_or_absent():
    setting = Setting("3d", DELTA, 1.0, "gaussian")
    assert LinearSolid("a", 1.0, 2.0, 1.0, critical_stretch=0.02).stretch_limit(setting) == 0.02
    assert math.isinf(LinearSolid("a", 1.0, 2.0, 1.0).stretch_limit(setting))


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("influence", ["constant", "inverse_distance", "gaussian", "conical"])
def test_the_cut_takes_the_energy_of_bonds_and_of_dilatation(dimension, influence):
    """s0 from G_c by brute force: halves of space apart by s0 of each crossing bond; W = (k - (d+2)G/d) theta^2/2 + d (d+2) G/(2 m) sum omega e^2, theta of both halves."""
    dim, h = (3, 1 / 24) if dimension == "3d" else (2, 1 / 120)
    solid = LinearSolid("a", 1.0, *LinearSolid.moduli(1.0, 0.4), energy_release_rate=1.0)
    setting = Setting(dimension, 1.0, 1.0, influence)
    axis = (np.arange(-round(1 / h), round(1 / h)) + 0.5) * h  # midpoints: none at the centre
    xi = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    r = np.linalg.norm(xi, axis=1)
    xi, r = xi[r < 1], r[r < 1]
    omega, volume = value(influence, r, 1.0), h**dim
    m = np.sum(omega * r**2) * volume
    k, g, energy = solid.bulk(setting), solid.shear_modulus, 0.0
    for z in (np.arange(400) + 0.5) / 400:
        cross = xi[:, -1] > z
        theta = dim / m * np.sum((omega * r * r)[cross]) * volume
        energy += 2 / 400 * (0.5 * (k - (dim + 2) / dim * g) * theta**2 + dim * (dim + 2) * g / (2 * m) * np.sum((omega * r**2)[cross]) * volume)
    assert solid.stretch_limit(setting) == pytest.approx(1 / math.sqrt(energy), rel=5e-3)  # the ball of cells is jagged


@pytest.mark.parametrize("path, dimension, nu, linear", list(itertools.product(PATHS, DIMENSIONS, (0.0, 0.4), (False, True))))
def test_homogeneous_strains_hold_the_energy_of_linear_elasticity(path, dimension, nu, linear):
    """An isotropic strain exactly; shear up to the lattice's lack of isotropy. Stress reaches twice as far as energy: the neighbours' dilatations count."""
    dim, ratio = (3, 3.0) if dimension == "3d" else (2, 4.0)
    text = plate((4 * int(ratio) + 3,) * dim, ratio, kinematics="linear" if linear else "finite", dimension=dimension)
    overrides = ["material.solid.model=lps", f"material.solid.poissons_ratio={nu}", f"particles.path={path}", "particles.influence=inverse_distance"]
    problem = problem_of(text, overrides)
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    centre, eps = int(np.argmin(np.linalg.norm(x, axis=1))), 1e-6
    bulk, shear = LinearSolid.moduli(1.0, nu)
    k = {"3d": bulk, "plane_strain": bulk + shear / 3, "plane_stress": 1 / (2 * (1 - nu))}[dimension]
    spread, sheared = np.eye(dim) * eps, np.zeros((dim, dim))
    sheared[0, 1] = sheared[1, 0] = eps
    for gradient, expected, tolerance in ((spread, 0.5 * k * (dim * eps) ** 2, 1e-9), (sheared, 2 * shear * eps**2, 0.05)):
        particles.put(particles.displacement, x @ gradient)
        problem.stepper()
        energy = strain_energy_density(problem.subdomain, problem.body.law)[centre]
        assert energy == pytest.approx(expected, rel=tolerance + (0 if linear else 1e-5))
    stress = field("stress", problem.subdomain, problem.body.law)[centre]
    assert stress[0, 1] == pytest.approx(2 * shear * eps, rel=0.05) and abs(stress[0, 0]) < 1e-4 * abs(stress[0, 1])


def test_two_materials_meet_each_with_its_own_half():
    soft, stiff = LinearSolid("soft", 1.0, 2.0, 1.0, critical_stretch=0.1), LinearSolid("stiff", 2.0, 6.0, 3.0, critical_stretch=0.2)
    law = LinearSolid.law([(soft, True), (stiff, True), (soft, False)], Setting("3d", 1.0, 1.0, "constant"))
    assert law.deviatoric.tolist() == [15.0, 45.0, 15.0] and law.density.tolist() == [1.0, 2.0, 1.0]
    assert law.critical_stretch[0, 1] == 0.1 and law.critical_stretch[1, 1] == 0.2 and np.all(np.isinf(law.critical_stretch[2]))
    assert np.all(law.bound >= 1.0) and law.bound[0] == max(1.0, 9 * 2.0 / 15.0)


def test_a_particle_without_bonds_has_no_state():
    problem = problem_of(plate((1, 1)), ["material.solid.model=lps", "material.solid.poissons_ratio=0.3", "time.dt=0.1"])
    problem.stepper().advance()
    assert np.all(problem.subdomain.particles.owned(problem.subdomain.state) == 0.0)
    assert np.all(problem.subdomain.particles.owned(problem.subdomain.particles.force_density) == 0.0)
    assert math.isinf(problem.critical_dt)
