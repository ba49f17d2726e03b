"""Whether shapes of a scene overlap, contain one another, or meet: exactly for boxes, disks and balls, by bounding boxes for cylinders; bores count as holes."""
from pdhpc.scene.fields import length


def overlap(first, second, slack):
    """Whether two bodies share more than their surfaces: they overlap by more than `slack` (m) and neither lies in a hole or the bore of the other."""
    if not _shapes_overlap(first, second, slack):
        return False
    pairs = (first, second), (second, first)
    return not any(_in_bore(one, other, slack) or any(_inside(one, hole, slack) for hole in other.hole) for one, other in pairs)


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
    """Whether a body certainly lies in a hole: round in round, cylinder in cylinder, else all corners of its bounding box; nothing but a tube in a hollow one."""
    bore = _bore_of(hole)
    if bore and not (body.shape == "cylinder" and _bore_of(body) - _across(body.start, hole) >= bore - slack and _parallel(body, hole)):
        return False
    if _is_round(body) and _is_round(hole):
        return length(_minus(body.center, hole.center)) + body.radius <= hole.radius + slack
    if body.shape == hole.shape == "cylinder":
        return all(_in_cylinder(end, hole, slack, body) for end in (body.start, body.end))
    return all(_contains(hole, corner, slack) for corner in _corners(body.bounding_box()))


def _in_bore(body, other, slack):
    """Whether a body certainly lies in the bore of another one, which goes on beyond its ends."""
    bore = _bore_of(other)
    if not bore:
        return False
    if body.shape == "cylinder":
        return all(_across(end, other) + body.radius <= bore + slack for end in (body.start, body.end))
    if _is_round(body):
        return _across(body.center, other) + body.radius <= bore + slack
    return all(_across(corner, other) <= bore + slack for corner in _corners(body.bounding_box()))


def _bore_of(shape):
    """Return the radius of the bore of a shape, 0 without one, m."""
    return (shape.inner_radius or 0.0) if shape.shape == "cylinder" else 0.0


def _across(point, cylinder):
    """Return the distance of a point from the axis of a cylinder, m."""
    size = length(cylinder.axis())
    offset = _minus(point, cylinder.start)
    along = _dot(offset, cylinder.axis()) / size
    return length([x - along * n / size for x, n in zip(offset, cylinder.axis())])


def _parallel(first, second):
    """Whether two cylinders have the same direction."""
    a, b = first.axis(), second.axis()
    return abs(_dot(a, b)) >= (1 - 1e-12) * length(a) * length(b)


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
