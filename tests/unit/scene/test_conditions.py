import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


def region(name, lower, upper):
    return f'[[region]]\nname = "{name}"\nshape = "box"\nlower = {lower}\nupper = {upper}\n'


@pytest.mark.parametrize("depth", [1, 3])
@pytest.mark.parametrize("path", PATHS)
def test_traction_gives_the_force_of_its_face(depth, path):
    """A region of any depth: total force = traction x length x thickness."""
    extra = region("top", [-10.0, 5.0 - depth], [10.0, 5.0]) + '[[load]]\ntype = "traction"\nregion = "top"\nface = "+y"\nvalue = [0.5, 2.0]\n'
    problem = problem_of(plate((20, 10), extra=extra), [f"particles.path={path}"])
    particles = problem.stepper().subdomain.particles
    total = particles.owned(particles.force_density * particles.volume[:, None]).sum(axis=0)
    assert total == pytest.approx([0.5 * 20, 2.0 * 20])


@pytest.mark.parametrize("path", PATHS)
def test_traction_on_the_face_of_a_cube(path):
    extra = '[[region]]\nname = "r"\nshape = "half_space"\npoint = [2.0, 0.0, 0.0]\nnormal = [1.0, 0.0, 0.0]\n[[load]]\ntype = "traction"\nregion = "r"\nface = "+x"\nvalue = [3.0, 0.0, 0.0]\n'
    problem = problem_of(plate((8, 6, 5), extra=extra, dimension="3d"), [f"particles.path={path}"])
    particles = problem.stepper().subdomain.particles
    assert particles.owned(particles.force_density).sum(axis=0) == pytest.approx([3.0 * 6 * 5, 0.0, 0.0])


@pytest.mark.parametrize("path", PATHS)
def test_gravity_and_force_density(path):
    extra = '[[load]]\ntype = "gravity"\nvalue = [0.0, -9.81]\n[[load]]\ntype = "force_density"\nregion = "all"\nvalue = [1.5, 0.0]\n'
    problem = problem_of(plate((6, 4), extra=extra).replace("density = 1.0\n", "density = 2.0\n"), [f"particles.path={path}"])
    particles = problem.stepper().subdomain.particles
    assert np.allclose(particles.owned(particles.force_density), [1.5, -2.0 * 9.81])


@pytest.mark.parametrize("path", PATHS)
def test_regions_can_be_tied_to_a_body(path):
    second = '[[body]]\nname = "right"\nmaterial = "solid"\nshape = "box"\nlower = [5.0, -5.0]\nupper = [9.0, 5.0]\n'
    extra = second + region("part", [0.0, -5.0], [9.0, 5.0]) + 'body = "right"\n[[load]]\ntype = "force_density"\nregion = "part"\nvalue = [1.0, 0.0]\n'
    problem = problem_of(plate((10, 10), extra=extra), [f"particles.path={path}"])
    particles = problem.stepper().subdomain.particles
    assert np.array_equal(particles.owned(particles.force_density)[:, 0] > 0.5, problem.subdomain.places()[:, 0] > 5.0)


@pytest.mark.parametrize("path", PATHS)
def test_initial_states_add_up(path):
    extra = '[[initial]]\nvelocity = [1.0, 2.0]\n[[initial]]\nvelocity_gradient = [[0.0, 3.0], [0.0, 0.0]]\norigin = [0.0, 1.0]\ndisplacement = [0.1, 0.0]\n'
    subdomain = problem_of(plate((4, 4), extra=extra), [f"particles.path={path}"]).subdomain
    particles, x = subdomain.particles, subdomain.places()
    assert np.allclose(particles.owned(particles.velocity), np.stack([1.0 + 3.0 * (x[:, 1] - 1.0), np.full(16, 2.0)], axis=1))
    assert np.allclose(particles.owned(particles.displacement), [0.1, 0.0])


@pytest.mark.parametrize("path", PATHS)
def test_a_body_that_expands_and_spins(path):
    extra = "[[initial]]\nvelocity = [1.0, 2.0]\n[[initial]]\nradial_velocity = [3.0]\nangular_velocity = [0.5]\norigin = [0.0, 1.0]\n"
    subdomain = problem_of(plate((4, 4), extra=extra), [f"particles.path={path}"]).subdomain
    x, y = subdomain.places().T
    r = np.hypot(x, y - 1.0)
    expected = np.stack([1.0 + 3.0 * x / r - 0.5 * (y - 1.0), 2.0 + 3.0 * (y - 1.0) / r + 0.5 * x], axis=1)
    assert np.allclose(subdomain.particles.owned(subdomain.particles.velocity), expected)
