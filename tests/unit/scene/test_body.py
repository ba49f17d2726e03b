import numpy as np

from pdhpc.geometry.shapes import Band, Disk, Within
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
