import pytest
from pydantic import TypeAdapter

from pdhpc.scene.cracks import Crack
from pdhpc.scene.fields import Rule

CRACK = TypeAdapter(Crack)


def test_bounding_boxes_of_cracks():
    disk = CRACK.validate_python({"type": "disk", "center": [0, 0, 0], "normal": [0, 0, 2], "radius": 3})
    assert disk.bounding_box() == ([-3, -3, 0], [3, 3, 0])
    rectangle = CRACK.validate_python({"type": "rectangle", "corner": [1, 0, 0], "edge1": [-2, 0, 0], "edge2": [0, 1, 1]})
    assert rectangle.bounding_box() == ([-1, 0, 0], [1, 1, 1])


@pytest.mark.parametrize("table, dim, words", [
    ({"type": "polyline", "points": [[0, 0], [0, 1]]}, 3, "in 3D"),
    ({"type": "rectangle", "corner": [0, 0, 0], "edge1": [1, 0, 0], "edge2": [2, 0, 0]}, 3, "not parallel"),
    ({"type": "disk", "center": [0, 0, 0], "normal": [0, 0, 0], "radius": 1}, 3, "not zero"),
    ({"type": "disk", "center": [0, 0, 0], "normal": [0, 0, 1], "radius": 1}, 2, "in 2D"),
])
def test_impossible_cracks_are_refused(table, dim, words):
    with pytest.raises(Rule, match=words):
        CRACK.validate_python(table).check(dim)
