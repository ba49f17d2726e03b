import numpy as np
import pytest
from pydantic import TypeAdapter

from pdhpc.scene.body import make_shape
from pdhpc.scene.fields import Rule
from pdhpc.scene.shapes import Crack, Region

REGION, CRACK = TypeAdapter(Region), TypeAdapter(Crack)
SHAPES = [
    {"shape": "box", "lower": [0, 0, 0], "upper": [1, 2, 3]},
    {"shape": "sphere", "center": [1, 0, 0], "radius": 2},
    {"shape": "cylinder", "start": [0, 0, 0], "end": [1, 1, 0], "radius": 0.5},
    {"shape": "half_space", "point": [0, 0, 0], "normal": [0, 0, 1]},
]


@pytest.mark.parametrize("table", SHAPES, ids=lambda table: table["shape"])
def test_bounding_boxes_are_those_of_the_geometry(table):
    region = REGION.validate_python({"name": "r", **table})
    region.check(3)
    for mine, geometry in zip(region.bounding_box(), make_shape(region).bounds()):
        assert np.allclose(mine, geometry)


@pytest.mark.parametrize("table", SHAPES[1:3], ids=lambda table: table["shape"])
def test_round_bodies_of_three_dimensions_are_refused_in_two(table):
    with pytest.raises(Rule, match="in 2D"):
        REGION.validate_python({"name": "r", **table}).check(2)


def test_bounding_boxes_of_cracks():
    disk = CRACK.validate_python({"type": "disk", "center": [0, 0, 0], "normal": [0, 0, 2], "radius": 3})
    assert disk.bounding_box() == ([-3, -3, 0], [3, 3, 0])
    rectangle = CRACK.validate_python({"type": "rectangle", "corner": [1, 0, 0], "edge1": [-2, 0, 0], "edge2": [0, 1, 1]})
    assert rectangle.bounding_box() == ([-1, 0, 0], [1, 1, 1])
