from pathlib import Path

import numpy as np
import pytest

from pdhpc.kernels.family import VARIED
from pdhpc.scene.build import build
from pdhpc.scene.gauges import make_gauges
from pdhpc.scene.read import parse_scene, read_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


def region(name, lower, upper):
    return f'[[region]]\nname = "{name}"\nshape = "box"\nlower = {lower}\nupper = {upper}\n'


@pytest.mark.parametrize("path", PATHS)
def test_a_hole_removes_particles(path):
    extra = '[[body.hole]]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 3.0\n'
    text = plate((20, 10)).replace("[time]", extra + "[time]")
    subdomain = problem_of(text, [f"particles.path={path}"]).subdomain
    assert np.linalg.norm(subdomain.places(), axis=1).min() > 3.0 and 150 < subdomain.particles.n_owned < 200


@pytest.mark.parametrize("path", PATHS)
def test_no_fail_regions_hold_whatever_happens(path):
    extra = region("held", [-10.0, -5.0], [0.0, 5.0]) + '[damage]\nno_fail = ["held"]\n[[initial]]\ndisplacement_gradient = [[0.5, 0.0], [0.0, 0.5]]\n'
    problem = problem_of(plate((20, 10), extra=extra, material="critical_stretch = 0.1", kinematics="finite"), [f"particles.path={path}"])
    stepper = problem.stepper()
    x, damage = stepper.subdomain.places()[:, 0], stepper.subdomain.bonds.damage()
    assert stepper.broken > 0 and np.all(damage[x < 0] == 0.0) and np.all(damage[x > 4] == 1.0)


@pytest.mark.parametrize("extra, words", [
    (region("r", [0.1, 0.1], [0.2, 0.2]) + '[[load]]\nname = "l"\ntype = "force_density"\nregion = "r"\nvalue = [1.0, 0.0]\n', "load 'l': region = \"r\", which selects no particle"),
    (region("r", [0.1, 0.1], [0.2, 0.2]) + '[[probe]]\nname = "p"\nregion = "r"\nquantity = "damage"\n', "probe 'p': region"),
    ('[[crack]]\nname = "c"\ntype = "polyline"\npoints = [[0.31, 0.22], [0.3100001, 0.22]]\n', "crack 'c' = a crack that cuts no bond"),
    (region("a", [0.0, 0.0], [5.0, 5.0]) + region("b", [-5.0, 0.0], [2.0, 5.0]) + "".join(
        f'[[load]]\ntype = "velocity"\nregion = "{name}"\nvalue = [1.0, "free"]\n' for name in "ab"), "prescribes the same component"),
])
def test_what_only_the_particles_show(extra, words, comm):
    with pytest.raises(SceneError) as caught:
        problem = problem_of(plate((10, 10), extra=extra))
        make_gauges(problem, problem.stepper().view, comm)
    assert words in str(caught.value)


def test_a_body_that_is_all_hole():
    text = plate((4, 4)).replace("[time]", '[[body.hole]]\nshape = "box"\nlower = [-2.0, -2.0]\nupper = [2.0, 2.0]\n[time]')
    with pytest.raises(SceneError, match="no particle"):
        problem_of(text)


BESIDE = '[[body]]\nname = "right"\nmaterial = "solid"\nshape = "box"\nlower = [{x}, -5.0]\nupper = [{y}, 5.0]\n'


@pytest.mark.parametrize("extra, asked, path", [
    ("", "auto", "lattice: the body is filled with one lattice"),
    ("", "lattice", "lattice: the body is filled with one lattice"),
    ("", "cloud", 'cloud: asked for by particles.path = "cloud"'),
    (BESIDE.format(x=7.0, y=9.0), "auto", "lattice: all bodies are filled with one lattice"),
    (BESIDE.format(x=7.25, y=9.25), "auto", "cloud: body 2 lies +0.250 spacings along x off the lattice of body 1"),
    (BESIDE.format(x=7.25, y=9.25), "cloud", 'cloud: asked for by particles.path = "cloud"'),
])
def test_the_path_is_the_lattice_where_there_is_one(extra, asked, path):
    problem = problem_of(plate((10, 10), extra=extra), [f"particles.path={asked}"])
    assert problem.body.path == path and hasattr(problem.subdomain.bonds.arrays, "offset") == path.startswith("lattice")
    assert problem.subdomain.particles.n_owned == (100 if not extra else 120)


def test_a_lattice_that_is_none_is_refused_with_the_reason():
    with pytest.raises(SceneError) as caught:
        problem_of(plate((10, 10), extra=BESIDE.format(x=7.25, y=9.25)), ["particles.path=lattice"])
    assert str(caught.value).startswith('verification scene: particles.path = "lattice" although body 2 lies +0.250 spacings along x off the lattice of body 1; allowed is "auto"')
    assert caught.value.where == "particles.path"


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("keys, expected", [
    ("bulk_modulus=5.0 shear_modulus=3.0", (5.0, 3.0)), ("youngs_modulus=9.0 poissons_ratio=0.35", (9.0 / (3 * 0.3), 9.0 / 2.7)),
])
def test_moduli_of_a_linear_solid_reach_the_kernels(path, keys, expected):
    text = plate((6, 5, 4), 2.0, dimension="3d").replace("youngs_modulus = 1.0\n", 'model = "lps"\n' + keys.replace(" ", "\n").replace("=", " = ") + "\n")
    body = problem_of(text, [f"particles.path={path}"]).body
    assert (body.materials[0].bulk_modulus, body.materials[0].shear_modulus) == pytest.approx(expected)
    assert body.law.deviatoric[0] == pytest.approx(15 * expected[1]) and body.law.spherical[0] * 25 * expected[1] ** 2 == pytest.approx(expected[0] - 5 * expected[1] / 3)


@pytest.mark.parametrize("name", ("everything_2d.toml", "everything_3d.toml"))
@pytest.mark.parametrize("path", PATHS)
def test_scenes_of_every_key_take_a_step_on_either_path(name, path, comm):
    problem = build(read_scene(Path(__file__).parent / name, [f"particles.path={path}"]), comm)
    make_gauges(problem, problem.stepper().view, comm)
    stepper = problem.stepper()
    stepper.advance()
    particles = problem.subdomain.particles
    assert np.all(np.isfinite(particles.owned(particles.displacement))) and np.any(particles.owned(particles.displacement) != 0.0)


def test_one_particle_and_no_bond(comm):
    with pytest.raises(SceneError, match="no particle has a bond"):
        problem_of(plate((1, 1)))
    problem = build(parse_scene(plate((1, 1)), "t", ["time.dt=0.5"]), comm)
    stepper = problem.stepper()
    stepper.advance()
    assert problem.subdomain.particles.n_owned == 1


NO_CORRECTION = ["particles.volume_correction=none"]
FINER = '[[body]]\nname = "finer"\nmaterial = "solid"\nshape = "box"\nlower = [5.0, -5.0]\nupper = [9.0, 5.0]\nspacing = 0.5\n'


def test_bodies_of_two_spacings():
    """Each body's particles have its own volume; bonds join both, and internal forces add up to nothing."""
    problem = problem_of(plate((10, 10), 4.0, extra=FINER), NO_CORRECTION)
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    assert problem.body.path == "cloud: body 2 has a spacing of 0.5 m, body 1 of 1 m" and particles.n_owned == 100 + 8 * 20
    finer = subdomain.places()[:, 0] > 5.0
    assert np.array_equal(particles.volume, np.where(finer, 0.25, 1.0)) and particles.volume.sum() == 140.0
    near = np.abs(subdomain.places()[:, 0] - 5.0) < 3.4
    assert np.all(subdomain.points.row_block[near] == VARIED) and np.all(subdomain.points.row_block[np.abs(subdomain.places()[:, 0] - 5.0) > 4.1] == 0)
    particles.displacement[:] = 1e-3 * np.sin(subdomain.places() @ [[0.3, 0.1], [0.2, 0.4]])
    stepper = problem.stepper()
    force = particles.force_density * particles.volume[:, None]
    assert np.abs(force[finer].sum(axis=0)).max() > 1e-5, "the bodies pull on each other"
    assert np.abs(force.sum(axis=0)).max() < 1e-15 * np.abs(force).sum() * 10
    assert stepper.view.n == 260


@pytest.mark.parametrize("path", PATHS)
def test_a_spacing_of_its_own_is_that_of_the_lattice(path):
    """The body of a scene whose particles.spacing is not its own, on either path, against the same one said the other way."""
    load = region("end", [4.0, -5.0], [5.0, 5.0]) + '[[load]]\ntype = "traction"\nregion = "end"\nface = "+x"\nvalue = [1.0, 0.0]\n'
    text = plate((10, 10), 4.0, extra=load)
    own = text.replace('name = "body"', 'name = "body"\nspacing = 0.5')
    found, expected = (problem_of(*each) for each in ((own, [*NO_CORRECTION, f"particles.path={path}"]), (text, [*NO_CORRECTION, "particles.spacing=0.5", f"particles.path={path}"])))
    assert found.body.path.startswith(path) and found.dt == expected.dt
    forces = [each.stepper().subdomain.particles for each in (found, expected)]
    assert np.array_equal(*(each.owned(each.force_density) for each in forces)) and forces[0].n_owned == 400


def test_a_traction_on_particles_of_two_sizes():
    """Total force = traction x length x thickness: a strip of both bodies, seen from above, is 4 + 4 m long."""
    load = region("top", [1.0, 4.0], [9.0, 5.0]) + '[[load]]\ntype = "traction"\nregion = "top"\nface = "+y"\nvalue = [0.0, 3.0]\n'
    problem = problem_of(plate((10, 10), 4.0, extra=FINER + load), [*NO_CORRECTION, "particles.thickness=0.1"])
    particles = problem.stepper().subdomain.particles
    assert (particles.force_density * particles.volume[:, None]).sum(axis=0) == pytest.approx([0.0, 3.0 * 8.0 * 0.1])
