import pytest
from pydantic import TypeAdapter

from pdhpc.scene.overlap import distance, meet, overlap, reaches
from pdhpc.scene.shapes import Body, Region

SLACK = 1e-9
BODY, REGION = TypeAdapter(Body), TypeAdapter(Region)


def body(shape, *holes, **keys):
    return BODY.validate_python({"name": "b", "material": "m", "shape": shape, "hole": list(holes), **keys})


def box(lower, upper, *holes):
    return body("box", *holes, lower=lower, upper=upper)


def disk(center, radius, *holes):
    return body("disk", *holes, center=center, radius=radius)


def cylinder(start, end, radius, *holes, **more):
    return body("cylinder", *holes, start=start, end=end, radius=radius, **more)


UNIT, DISK_HOLE = ([0, 0], [1, 1]), {"shape": "disk", "center": [0.5, 0.5], "radius": 0.25}
BORE = {"shape": "cylinder", "start": [0, 0, 0], "end": [0, 0, 4], "radius": 1}
TUBE = cylinder([0, 0, 0], [0, 0, 4], 2, inner_radius=1)
RING_HOLE = box([-3, -3, 0], [3, 3, 4], {"shape": "cylinder", "start": [0, 0, 0], "end": [0, 0, 4], "radius": 2, "inner_radius": 1})


@pytest.mark.parametrize("first, second, expected", [
    (box(*UNIT), box([1, 0], [2, 1]), False),  # touching
    (box(*UNIT), box([0.9, 0.9], [2, 2]), True),
    (disk([0, 0], 1), disk([1.5, 1.5], 1), False),  # the bounding boxes overlap, the disks stand sqrt(4.5) > 2 apart
    (disk([0, 0], 1), disk([1.4, 1.4], 1), True),  # sqrt(3.92) < 2
    (disk([2, 2], 1.4), box(*UNIT), False),  # the box's corner stands sqrt(2) from the centre
    (disk([2, 2], 1.42), box(*UNIT), True),
    (box(*UNIT, DISK_HOLE), disk([0.5, 0.5], 0.25), False),  # an inclusion fills the hole
    (box(*UNIT, DISK_HOLE), disk([0.5, 0.5], 0.3), True),
    (box(*UNIT, DISK_HOLE), box([0.4, 0.4], [0.6, 0.6]), False),  # its corners stand 0.14 from the centre
    (box(*UNIT, DISK_HOLE), box([0.3, 0.3], [0.7, 0.7]), True),  # 0.28
    (box(*UNIT, {"shape": "half_space", "point": [0.5, 0], "normal": [1, 0]}), box([0.5, 0], [1, 1]), False),
    (box([-2, -2, 0], [2, 2, 4], BORE), cylinder([0, 0, 1], [0, 0, 3], 1), False),
    (box([-2, -2, 0], [2, 2, 4], BORE), cylinder([0, 0, 1], [0, 0, 3], 1.1), True),
    (box([-2, -2, 0], [2, 2, 4], BORE), cylinder([0.3, 0, 1], [0.3, 0, 3], 0.7), False),
    (TUBE, cylinder([0, 0, -3], [0, 0, 9], 1), False),  # fills the bore and sticks out of it
    (TUBE, cylinder([0, 0, 0], [0, 0, 4], 1.1), True),
    (TUBE, cylinder([0.3, 0, 0], [0.3, 0, 4], 0.7), False),
    (TUBE, cylinder([0.4, 0, 0], [0.4, 0, 4], 0.7), True),
    (TUBE, cylinder([-0.6, 0, 1], [0.6, 0, 3], 0.4), False),  # across the bore, end discs within it
    (TUBE, body("sphere", center=[0.5, 0, 9], radius=0.5), False),
    (TUBE, body("sphere", center=[0.5, 0, 2], radius=0.6), True),
    (TUBE, box([-0.7, -0.7, 1], [0.7, 0.7, 2]), False),  # its corners stand 0.99 from the axis
    (TUBE, box([-0.8, -0.8, 1], [0.8, 0.8, 2]), True),
    (TUBE, cylinder([0, 0, 0], [0, 0, 4], 3, inner_radius=2), False),  # a tube around the tube
    (TUBE, cylinder([0, 0, 0], [0, 0, 4], 3, inner_radius=1.9), True),
    (RING_HOLE, cylinder([0, 0, 1], [0, 0, 3], 2, inner_radius=1), False),  # a tube in a ring cut out of a box
    (RING_HOLE, cylinder([0, 0, 1], [0, 0, 3], 2, inner_radius=0.9), True),
    (RING_HOLE, cylinder([0, 0, 1], [0, 0, 3], 2), True),  # the box still fills the ring's middle
    (box([-2, -2, 0], [2, 2, 4], BORE), cylinder([0, 0, 1], [0, 0, 5], 1), True),  # sticks out of the bore: still beside the box, as far as bounding boxes tell no
])
def test_overlap(first, second, expected):
    assert overlap(first, second, SLACK) is expected and overlap(second, first, SLACK) is expected


def test_regions_reach_bodies():
    unit = ([0.0, 0.0], [1.0, 1.0])

    def region(**table):
        return REGION.validate_python({"name": "r", **table})

    assert reaches(region(shape="half_space", point=[1, 0], normal=[1, 0]), unit)
    assert not reaches(region(shape="half_space", point=[1.1, 0], normal=[1, 0]), unit)
    assert reaches(region(shape="half_space", point=[1.1, 0], normal=[-1, 0]), unit)
    assert not reaches(region(shape="disk", center=[2, 2], radius=1.4), unit)
    assert reaches(region(shape="disk", center=[2, 2], radius=1.42), unit)
    assert reaches(region(shape="box", lower=[1, 1], upper=[2, 2]), unit)


def test_boxes_and_points():
    assert meet(([0, 0], [1, 1]), ([1, 1], [2, 2])) and not meet(([0, 0], [1, 1]), ([0, 1.1], [2, 2]))
    assert distance([4, 5], ([0, 0], [1, 1])) == 5.0 and distance([0.5, 0.5], ([0, 0], [1, 1])) == 0.0
