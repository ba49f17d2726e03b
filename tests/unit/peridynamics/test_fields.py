import numpy as np
import pytest

from pdhpc.peridynamics.fields import FIELDS, field
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import MODELS, PATHS

LPS = ["material.solid.model=lps", "material.solid.poissons_ratio=0.2"]


def stretched(gradient, kinematics, dimension="plane_stress", ratio=4.0, path="lattice", overrides=()):
    """A body with u = G x, forces evaluated; returns problem and the index of its centre."""
    dim = len(gradient)
    reach = 4 if overrides else 2  # in horizons: of a linear solid, the neighbours' dilatations count
    problem = problem_of(plate((reach * int(ratio) + 5,) * dim, ratio, 1.0, kinematics, dimension=dimension), [f"particles.path={path}", *overrides])
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, x @ np.asarray(gradient).T)
    problem.stepper()
    return problem, int(np.argmin(np.linalg.norm(x, axis=1)))


@pytest.mark.parametrize("kinematics", ["linear", "finite"])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("overrides", ([], LPS), ids=MODELS)
def test_strain_of_an_affine_deformation_is_exact_everywhere(kinematics, dim, path, overrides):
    gradient = np.array([[0.10, 0.05, 0.0], [-0.02, 0.03, 0.01], [0.0, 0.04, -0.06]])[:dim, :dim]
    problem, _ = stretched(gradient, kinematics, "plane_stress" if dim == 2 else "3d", 2.0, path, overrides)
    expected = 0.5 * (gradient + gradient.T) + (0.5 * gradient.T @ gradient if kinematics == "finite" else 0.0)
    assert np.abs(field("strain", problem.subdomain, problem.body.law) - expected).max() < 1e-12


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("overrides, nu", [([], 1 / 3), (LPS, 0.2)], ids=MODELS)
def test_stress_approaches_hooke_s_law(path, overrides, nu):
    gradient = np.array([[1e-3, 0.0], [0.0, 0.0]])
    problem, centre = stretched(gradient, "linear", ratio=8.0, path=path, overrides=overrides)
    stress = field("stress", problem.subdomain, problem.body.law)[centre]
    assert stress[0, 0] == pytest.approx(1e-3 / (1 - nu**2), rel=0.02)
    assert stress[1, 1] == pytest.approx(nu * 1e-3 / (1 - nu**2), rel=0.02)
    assert abs(stress[0, 1]) < 1e-15 and abs(stress[1, 0]) < 1e-15


@pytest.mark.parametrize("path", PATHS)
def test_stress_is_the_derivative_of_the_energy_density(path):
    def energy(gradient):
        problem, centre = stretched(gradient, "finite", path=path)
        return field("strain_energy_density", problem.subdomain, problem.body.law)[centre]

    gradient = np.array([[0.10, 0.05], [-0.02, 0.03]])
    problem, centre = stretched(gradient, "finite", path=path)
    stress = field("stress", problem.subdomain, problem.body.law)[centre]
    for a in range(2):
        for b in range(2):
            step = np.zeros((2, 2))
            step[a, b] = 1e-5
            assert stress[a, b] == pytest.approx((energy(gradient + step) - energy(gradient - step)) / 2e-5, rel=1e-6)


@pytest.mark.parametrize("path", PATHS)
def test_a_direction_without_bonds_has_no_strain(path):
    problem = problem_of(plate((9, 1), 3.0, 1.0, "finite"), [f"particles.path={path}"])
    particles = problem.subdomain.particles
    particles.put(particles.displacement, problem.subdomain.places() * [0.1, 0.0])
    problem.stepper()
    strain = field("strain", problem.subdomain, problem.body.law)
    assert np.allclose(strain[:, 0, 0], 0.1 + 0.5 * 0.01) and np.allclose(strain[:, 1, 1], 0.0)


@pytest.mark.parametrize("path", PATHS)
def test_shapes_of_all_fields(path):
    problem = problem_of(plate((4, 3)), [f"particles.path={path}"])
    problem.stepper()
    shapes = {name: field(name, problem.subdomain, problem.body.law).shape for name in FIELDS}
    assert {shapes[name] for name in ("displacement", "velocity", "force_density")} == {(12, 2)}
    assert {shapes[name] for name in ("stress", "strain")} == {(12, 2, 2)}
    assert {shapes[name] for name in ("damage", "precrack", "strain_energy_density", "active")} == {(12,)}
