import numpy as np
import pytest
from pydantic import TypeAdapter

from pdhpc.scene.body import make_shape
from pdhpc.scene.fields import Rule
from pdhpc.scene.shapes import Region

REGION = TypeAdapter(Region)
SHAPES = [
    {"shape": "box", "lower": [0, 0, 0], "upper": [1, 2, 3]},
    {"shape": "sphere", "center": [1, 0, 0], "radius": 2},
    {"shape": "cylinder", "start": [0, 0, 0], "end": [1, 1, 0], "radius": 0.5},
    {"shape": "cylinder", "start": [0, 0, 0], "end": [1, 1, 0], "radius": 0.5, "inner_radius": 0.4},
    {"shape": "half_space", "point": [0, 0, 0], "normal": [0, 0, 1]},
]


@pytest.mark.parametrize("table", SHAPES, ids=lambda table: table["shape"])
def test_bounding_boxes_are_those_of_the_geometry(table):
    region = REGION.validate_python({"name": "r", **table})
    region.check(3)
    for mine, geometry in zip(region.bounding_box(), make_shape(region).bounds()):
        assert np.allclose(mine, geometry)


def test_a_bore_is_narrower_than_its_cylinder():
    with pytest.raises(Rule, match="below radius = 0.5"):
        REGION.validate_python({"name": "r", **SHAPES[2], "inner_radius": 0.5}).check(3)


@pytest.mark.parametrize("table", SHAPES[1:4], ids=lambda table: table["shape"])
def test_round_bodies_of_three_dimensions_are_refused_in_two(table):
    with pytest.raises(Rule, match="in 2D"):
        REGION.validate_python({"name": "r", **table}).check(2)
