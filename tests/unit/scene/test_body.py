import numpy as np
import pytest

from pdhpc.geometry.shapes import Band, Disk, Within
from pdhpc.materials.law import Weighting
from pdhpc.scene.body import calibration_of, make_body, make_shape, radius_of
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate


def test_bodies_and_windows():
    scene = parse_scene(plate((6, 4)), "scene")
    body = make_body(scene)
    assert body.path.startswith("lattice") and body.cell_volume == 1.0 and radius_of(scene) < 3.5 < 1.001 * radius_of(scene)
    assert np.array_equal(body.number_of(np.array([0, 23])), [0, 0]) and calibration_of(scene).horizon == 3.0
    seen = body.seen_through(Within(Disk((-2.5, -1.5), 0.1), 1.0))
    ids, points = seen.lattices[0].points_in([-np.inf] * 2, [np.inf] * 2)
    assert np.array_equal(ids, [0, 1, 4]) and len(points) == 3, "ids stay those of the whole body"


def test_a_band_from_the_scene():
    extra = '[fine]\nshape = "band"\npoints = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]\nradius = 0.5\n'
    shape = make_shape(parse_scene(plate((6, 4), extra=extra), "scene").fine)
    assert isinstance(shape, Band) and np.allclose(shape.distance(np.array([[0.5, 0.5], [0.5, 1.0], [2.0, 1.0], [1.0, 3.0]])), [0.0, 0.0, 0.5, 0.5])


SECOND = """
[[body]]
name = "other"
material = "solid"
shape = "box"
lower = [3.0, -2.0]
upper = [9.0, 2.0]
"""


def two_bodies(extra="", overrides=()):
    return make_body(parse_scene(plate((6, 4), extra=SECOND + extra), "t", overrides))


def test_one_horizon_is_one_kind_and_one_radius():
    body = two_bodies('[[interface]]\nbodies = ["body", "other"]\nbonds = "glued"\n', ["body.other.horizon=3.0"])
    assert body.path.startswith("lattice") and np.ndim(body.reach) == 0 and [number for number, _ in body.kinds] == [0] and len(body.law.density) == 1


def test_horizons_that_differ_are_kinds_of_their_own():
    body = two_bodies(overrides=["body.other.horizon=4.0"])
    assert body.path == "cloud: horizons of bodies differ" and np.allclose(body.reach, [[3.5, 4.0], [4.0, 4.5]])
    assert [setting.horizon for _, setting in body.kinds] == [3.0, 4.0] and body.blocks == {(0, True): 0, (1, True): 1}
    assert body.law.weighting.horizon.tolist() == [[3.0, 3.5], [3.5, 4.0]]


def test_an_interface_without_bonds():
    from pdhpc.study.verify.case import problem_of

    words = '[[interface]]\nbodies = ["other", "body"]\nbonds = "none"\n'
    body = two_bodies(words)
    assert body.path == "cloud: the interface of 'other' and 'body' has no bonds"
    assert np.allclose(body.reach, [[3.5, 0.0], [0.0, 3.5]]) and isinstance(body.law.weighting, Weighting)
    problem, apart = problem_of(plate((6, 4), extra=SECOND + words)), problem_of(plate((6, 4)), ["particles.path=cloud"])
    assert problem.subdomain.bonds.n_directed == 2 * apart.subdomain.bonds.n_directed


FINER = '[[body]]\nname = "finer"\nmaterial = "solid"\nshape = "box"\nlower = [3.0, -2.0]\nupper = [6.0, 2.0]\nspacing = 0.5\n'


def test_a_spacing_of_its_own_enters_the_volume_correction():
    """Families end at horizon + spacing/2, of a pair at the mean of both; without correction, and with the conical influence, spacings do not matter."""
    scene = parse_scene(plate((6, 4), extra=FINER), "t")
    body = make_body(scene)
    assert body.path == "cloud: spacings of bodies differ" and len(body.kinds) == 2
    assert body.reach == pytest.approx(np.array([[3.5, 3.375], [3.375, 3.25]])) and radius_of(scene) == body.reach[0, 0]
    assert np.diag(body.law.weighting.ramp_slope).tolist() == [1.0, 2.0]
    for override in ("particles.volume_correction=none", "particles.influence=conical"):
        body = make_body(parse_scene(plate((6, 4), extra=FINER), "t", [override]))
        assert np.ndim(body.reach) == 0 and len(body.kinds) == 1


def test_one_body_of_its_own_spacing_is_that_of_the_scene():
    own, scenes = (make_body(parse_scene(plate((6, 4), 3.0), "t", [f"{key}=0.5", "particles.horizon=2.0"])) for key in ("body.body.spacing", "particles.spacing"))
    assert own.reach == scenes.reach and own.volumes == scenes.volumes and own.path == scenes.path and own.law.weighting == scenes.law.weighting
    assert np.array_equal(own.law.micromodulus, scenes.law.micromodulus)
