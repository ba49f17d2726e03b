"""A camera far away, and balls behind a depth buffer, against what geometry says."""
import math

import numpy as np
import pytest

from pdhpc.output.rendering import Camera, Canvas


def canvas(longest=100, azimuth=-90.0, elevation=0.0):
    return Canvas(Camera.at(azimuth, elevation), (0.0, 0.0), (10.0, 5.0), longest)


def test_where_the_camera_stands():
    """In front, at -y: x to the right, z up; from above, z comes towards it; always three unit vectors at right angles, right-handed."""
    front, above = Camera.at(-90.0, 0.0), Camera.at(-90.0, 90.0)
    assert np.allclose(front, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15) and np.allclose(above, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-15)
    for angles in ((-60.0, 30.0), (200.0, -70.0)):
        axes = np.array(Camera.at(*angles))
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-15) and np.linalg.det(axes) == pytest.approx(1.0)
    assert Camera.at(0.0, 30.0).toward == pytest.approx([math.cos(math.pi / 6), 0.0, 0.5])


def test_frame_of_a_box():
    """A unit cube seen along its diagonal: a hexagon sqrt(2) wide and 2 sqrt(2/3) high."""
    low, high = Camera.at(45.0, math.degrees(math.atan(math.sqrt(0.5)))).extent((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert high - low == pytest.approx([math.sqrt(2), 2 * math.sqrt(2 / 3)])


def test_a_ball_is_a_disk_of_its_radius_and_bulges():
    picture = canvas()
    assert picture.pixel == 0.1 and picture.value.shape == (50, 100) and picture.extent == (0.0, 10.0, 0.0, 5.0)
    picture.draw([[4.0, 7.0, 3.0]], [1.5], [0.25])
    covered = np.isfinite(picture.depth)
    rows, columns = np.nonzero(covered)
    x, z = 0.1 * (columns + 0.5) - 4.0, 0.1 * (rows + 0.5) - 3.0
    assert covered.sum() * 0.01 == pytest.approx(math.pi * 1.5**2, rel=0.02) and np.all(x**2 + z**2 <= 1.5**2)
    assert picture.depth[covered] == pytest.approx(-7.0 + np.sqrt(1.5**2 - x**2 - z**2)), "towards the camera is -y"
    assert np.all(picture.value[covered] == 0.25) and np.all(np.isnan(picture.value[~covered]))


@pytest.mark.parametrize("order", ([0, 1, 2, 3], [3, 2, 1, 0]))
def test_the_nearest_ball_is_seen(order):
    """Whatever the order; one behind, one in front, one without a value and one beside the frame, and a ball smaller than a pixel."""
    points, values = np.array([[4.0, 2.0, 3.0], [4.0, -2.0, 3.0], [4.0, -9.0, 3.0], [20.0, 0.0, 3.0]]), np.array([1.0, 2.0, np.nan, 4.0])
    picture = canvas()
    picture.draw(points[order], np.ones(4), values[order])
    assert set(np.unique(picture.value[np.isfinite(picture.value)])) == {2.0} and picture.value[30, 40] == 2.0
    picture.draw([[8.03, 0.0, 1.03], [np.nan, 0.0, 1.0]], [1e-9, 1.0], [5.0, 6.0])
    assert np.argwhere(picture.value == 5.0).tolist() == [[10, 80]] and not np.any(picture.value == 6.0)


def test_light_falls_on_slopes():
    """A flat sheet faces the camera: ambient light 0.45 and 0.55 times the light's own slant. One that turns towards the light is brighter; nothing is white."""
    def sheet(slope):
        picture = canvas(200)
        x, z = (grid.ravel() for grid in np.meshgrid(np.linspace(0.0, 8.0, 161), np.linspace(0.0, 5.0, 101)))
        picture.draw(np.stack([x, slope * x, z], axis=1), np.full(len(x), 0.04), np.ones(len(x)))
        light = picture.light()
        assert np.all(light[:, 180:] == 1.0)
        return light[30:70, 40:120].mean()

    light = np.array([-0.35, 0.45, 0.82])
    light /= np.linalg.norm(light)
    assert sheet(0.0) == pytest.approx(0.45 + 0.55 * light[2], abs=0.01)
    normal = np.array([-0.5, 0.0, 1.0]) / math.sqrt(1.25)  # depth = 0.5 x
    assert sheet(-0.5) == pytest.approx(0.45 + 0.55 * light @ normal, abs=0.02) and sheet(-0.5) > sheet(0.0) > sheet(0.5)


def test_an_empty_picture_is_white():
    assert np.all(canvas().light() == 1.0)
