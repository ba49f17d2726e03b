"""Pre-cracks as tables of the scene."""
from typing import Literal, Optional

from pdhpc.scene.fields import Matrix, Name, Positive, Rule, Vector, check_direction, check_vector, key, length
from pdhpc.scene.shapes import ShapeTable, check_polyline, one_of, only_in


class _Crack(ShapeTable):
    name: Optional[Name] = key("name of the crack", default=None)


class PolylineCrack(_Crack):
    """Pre-crack along a polyline in 2D."""

    type: Literal["polyline"] = key("crack along a polyline, 2D")
    points: Matrix = key("corners of the polyline", "m")

    def check(self, dim):
        """Raise a Rule in 3D, for fewer than two points, or for a segment without length."""
        only_in(2, dim, "type", "polyline", "rectangle or disk")
        check_polyline(self.points, dim)

    def bounding_box(self):
        """Return (lower, upper), m."""
        return [min(x) for x in zip(*self.points)], [max(x) for x in zip(*self.points)]


class RectangleCrack(_Crack):
    """Flat pre-crack spanned by two edges in 3D."""

    type: Literal["rectangle"] = key("flat crack spanned by two edges, 3D")
    corner: Vector = key("corner", "m")
    edge1: Vector = key("edge from the corner", "m")
    edge2: Vector = key("other edge from the corner", "m")

    def check(self, dim):
        """Raise a Rule in 2D or for parallel edges."""
        only_in(3, dim, "type", "rectangle", "polyline")
        check_vector("corner", self.corner, dim)
        check_direction("edge1", self.edge1, dim)
        check_direction("edge2", self.edge2, dim)
        a, b = self.edge1, self.edge2
        cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        if length(cross) <= 1e-9 * length(a) * length(b):
            raise Rule("edge2", b, f"an edge not parallel to edge1 = {a}")

    def bounding_box(self):
        """Return (lower, upper), m."""
        sides = [[0.0, a, b, a + b] for a, b in zip(self.edge1, self.edge2)]
        return [c + min(s) for c, s in zip(self.corner, sides)], [c + max(s) for c, s in zip(self.corner, sides)]


class DiskCrack(_Crack):
    """Penny-shaped pre-crack in 3D."""

    type: Literal["disk"] = key("penny-shaped crack, 3D")
    center: Vector = key("centre", "m")
    normal: Vector = key("normal of its plane", "1")
    radius: Positive = key("radius", "m")

    def check(self, dim):
        """Raise a Rule in 2D or for a zero normal."""
        only_in(3, dim, "type", "disk", "polyline")
        check_vector("center", self.center, dim)
        check_direction("normal", self.normal, dim)

    def bounding_box(self):
        """Return (lower, upper), m."""
        size = length(self.normal)
        reach = [self.radius * max(0.0, 1 - (n / size) ** 2) ** 0.5 for n in self.normal]
        return [c - r for c, r in zip(self.center, reach)], [c + r for c, r in zip(self.center, reach)]


Crack = one_of([PolylineCrack, RectangleCrack, DiskCrack], "type")
