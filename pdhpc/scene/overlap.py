"""Whether shapes of a scene overlap, contain one another, or meet: exactly for boxes, disks and balls, by bounding boxes for cylinders."""
from pdhpc.scene.fields import length


def overlap(first, second, slack):
    """Whether two bodies share more than their surfaces: they overlap by more than `slack` (m) and neither lies in a hole of the other."""
    if not _shapes_overlap(first, second, slack):
        return False
    return not any(_inside(one, hole, slack) for one, other in ((first, second), (second, first)) for hole in other.hole)


def meet(first, second):
    """Whether two bounding boxes (lower, upper) touch or overlap."""
    return all(a <= d and c <= b for a, b, c, d in zip(*first, *second))


def reaches(shape, box):
    """Whether a shape touches a box (lower, upper); for a cylinder, whether its bounding box does."""
    if _is_round(shape):
        return distance(shape.center, box) <= shape.radius
    if shape.shape == "half_space":
        return _signed_distance(shape, [high if n > 0 else low for low, high, n in zip(*box, shape.normal)]) >= 0
    return meet(shape.bounding_box(), box)


def distance(point, box):
    """Return the distance of a point from a box (lower, upper), 0 inside, m."""
    return length([max(low - x, 0.0, x - high) for x, low, high in zip(point, *box)])


def _is_round(shape):
    return shape.shape in ("disk", "sphere")


def _shapes_overlap(first, second, slack):
    if _is_round(first) and _is_round(second):
        return length(_minus(first.center, second.center)) < first.radius + second.radius - slack
    for one, other in ((first, second), (second, first)):
        if _is_round(one) and other.shape == "box":
            return distance(one.center, other.bounding_box()) < one.radius - slack
    return all(a < d - slack and c < b - slack for a, b, c, d in zip(*first.bounding_box(), *second.bounding_box()))


def _inside(body, hole, slack):
    """Whether a body certainly lies in a hole: round in round, cylinder in cylinder, else all corners of its bounding box."""
    if _is_round(body) and _is_round(hole):
        return length(_minus(body.center, hole.center)) + body.radius <= hole.radius + slack
    if body.shape == hole.shape == "cylinder":
        return all(_in_cylinder(end, hole, slack, body) for end in (body.start, body.end))
    return all(_contains(hole, corner, slack) for corner in _corners(body.bounding_box()))


def _contains(shape, point, slack):
    if shape.shape == "box":
        return distance(point, shape.bounding_box()) <= slack
    if shape.shape == "half_space":
        return _signed_distance(shape, point) >= -slack
    if shape.shape == "cylinder":
        return _in_cylinder(point, shape, slack)
    return length(_minus(point, shape.center)) <= shape.radius + slack


def _in_cylinder(point, cylinder, slack, body=None):
    """Whether a point lies in a cylinder; with a cylindrical `body`, whether its whole end disc around the point certainly does."""
    size = length(cylinder.axis())
    axis = [x / size for x in cylinder.axis()]
    offset = _minus(point, cylinder.start)
    along = _dot(offset, axis)
    across = length([x - along * n for x, n in zip(offset, axis)])
    radius = tilt = 0.0
    if body is not None:
        radius = body.radius
        tilt = radius * max(0.0, 1 - (_dot(body.axis(), axis) / length(body.axis())) ** 2) ** 0.5  # reach of the disc along the axis
    return across + radius <= cylinder.radius + slack and tilt - slack <= along <= size - tilt + slack


def _corners(box):
    corners = [[]]
    for low, high in zip(*box):
        corners = [corner + [x] for corner in corners for x in (low, high)]
    return corners


def _signed_distance(half_space, point):
    """Return how far a point lies inside a half space, m."""
    return _dot(_minus(point, half_space.point), half_space.normal) / length(half_space.normal)


def _minus(a, b):
    return [x - y for x, y in zip(a, b)]


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b))
