"""Shapes of bodies, holes and regions as tables of the scene."""
import math
from typing import Annotated, ClassVar, List, Literal, Optional, Union

from pydantic import Field

from pdhpc.scene.fields import AutoOrRatio, Integer, Listed, Matrix, Name, Positive, Rule, Table, Text, Vector, check_direction, check_vector, key, length


class ShapeTable(Table):
    """A table that holds a shape; check(dim) raises a Rule, bounding_box() returns (lower, upper), measure() its volume (2D: area)."""

    def check(self, dim):
        """Raise a Rule when the shape is impossible in `dim` dimensions."""

    def bounding_box(self):
        """Return (lower, upper), m."""

    def measure(self):
        """Return the volume in m^3, in 2D the area in m^2, or None without a closed form."""


def only_in(dimension, dim, word, kind, instead):
    """Raise a Rule when a kind of shape does not exist in `dim` dimensions."""
    if dim != dimension:
        raise Rule(word, f'"{kind}"', f"{instead} in {dim}D")


class BoxShape(ShapeTable):
    """Axis-aligned box."""

    shape: Literal["box"] = key("axis-aligned box")
    lower: Vector = key("corner with the smallest coordinates", "m")
    upper: Vector = key("corner with the largest coordinates", "m")

    def check(self, dim):
        """Raise a Rule unless lower < upper in every direction."""
        check_vector("lower", self.lower, dim)
        check_vector("upper", self.upper, dim)
        if not all(low < high for low, high in zip(self.lower, self.upper)):
            raise Rule("upper", self.upper, f"a corner above lower = {self.lower} in every direction")

    def bounding_box(self):
        """Return (lower, upper), m."""
        return list(self.lower), list(self.upper)

    def measure(self):
        """Return the product of its sides."""
        return math.prod(high - low for low, high in zip(self.lower, self.upper))


class _Round(ShapeTable):
    center: Vector = key("centre", "m")
    radius: Positive = key("radius", "m")

    def bounding_box(self):
        """Return (lower, upper), m."""
        return [x - self.radius for x in self.center], [x + self.radius for x in self.center]


class DiskShape(_Round):
    """Disk in 2D."""

    shape: Literal["disk"] = key("disk, 2D")

    def check(self, dim):
        """Raise a Rule in 3D."""
        only_in(2, dim, "shape", "disk", "box, sphere or cylinder")
        check_vector("center", self.center, dim)

    def measure(self):
        """Return pi R^2."""
        return math.pi * self.radius**2


class SphereShape(_Round):
    """Ball in 3D."""

    shape: Literal["sphere"] = key("ball, 3D")

    def check(self, dim):
        """Raise a Rule in 2D."""
        only_in(3, dim, "shape", "sphere", "box or disk")
        check_vector("center", self.center, dim)

    def measure(self):
        """Return 4/3 pi R^3."""
        return 4 / 3 * math.pi * self.radius**3


class CylinderShape(ShapeTable):
    """Cylinder in 3D, solid or hollow."""

    shape: Literal["cylinder"] = key("cylinder with flat ends, 3D")
    start: Vector = key("centre of one end", "m")
    end: Vector = key("centre of the other end", "m")
    radius: Positive = key("radius", "m")
    inner_radius: Optional[Positive] = key("radius of its bore, in which another body may lie (default: none, a solid cylinder)", "m", default=None)

    def check(self, dim):
        """Raise a Rule in 2D, for ends that coincide, or for a bore as wide as the cylinder."""
        only_in(3, dim, "shape", "cylinder", "box or disk")
        check_vector("start", self.start, dim)
        check_vector("end", self.end, dim)
        if length(self.axis()) == 0:
            raise Rule("end", self.end, "a point other than start")
        if self.inner_radius is not None and self.inner_radius >= self.radius:
            raise Rule("inner_radius", self.inner_radius, f"a number above 0 and below radius = {self.radius}")

    def measure(self):
        """Return pi (R^2 - R_bore^2) times its length."""
        return math.pi * (self.radius**2 - (self.inner_radius or 0.0) ** 2) * length(self.axis())

    def axis(self):
        """Return the vector from start to end, m."""
        return [b - a for a, b in zip(self.start, self.end)]

    def bounding_box(self):
        """Return (lower, upper), m: a disc of radius R and unit normal n reaches R sqrt(1 - n_i^2) along axis i."""
        span = length(self.axis())
        reach = [self.radius * max(0.0, 1 - (x / span) ** 2) ** 0.5 for x in self.axis()]
        lower = [min(a, b) - r for a, b, r in zip(self.start, self.end, reach)]
        return lower, [max(a, b) + r for a, b, r in zip(self.start, self.end, reach)]


class HalfSpaceShape(ShapeTable):
    """Half space."""

    shape: Literal["half_space"] = key("all points on one side of a line or plane")
    point: Vector = key("point on the boundary", "m")
    normal: Vector = key("direction into the half space", "1")

    def check(self, dim):
        """Raise a Rule for a zero normal."""
        check_vector("point", self.point, dim)
        check_direction("normal", self.normal, dim)

    def bounding_box(self):
        """Return (lower, upper), m: infinite."""
        return [-float("inf")] * len(self.point), [float("inf")] * len(self.point)


class BandShape(ShapeTable):
    """Band around a polyline."""

    shape: Literal["band"] = key("all points near a polyline")
    points: Matrix = key("corners of the polyline", "m")
    radius: Positive = key("largest distance from the polyline", "m")

    def check(self, dim):
        """Raise a Rule for fewer than two points, or for a segment without length."""
        check_polyline(self.points, dim)

    def bounding_box(self):
        """Return (lower, upper), m."""
        return [min(x) - self.radius for x in zip(*self.points)], [max(x) + self.radius for x in zip(*self.points)]


def check_polyline(points, dim):
    """Raise a Rule for fewer than two points, or for a segment without length."""
    for number, point in enumerate(points):
        check_vector(f"points[{number}]", point, dim)
    if len(points) < 2 or any(a == b for a, b in zip(points[:-1], points[1:])):
        raise Rule("points", points, "at least two points, each different from the one before")


def one_of(models, word):
    """Return the union of table models told apart by the key `word`."""
    return Annotated[Union[tuple(models)], Field(discriminator=word)]


Hole = one_of([BoxShape, DiskShape, SphereShape, CylinderShape, HalfSpaceShape], "shape")


class _Named(ShapeTable):
    name: Name = key("name of the body")
    material: Name = key("name of its material")
    horizon: Optional[Positive] = key(
        "horizon of the body (default that of [particles]), at least 2 spacings; bonds between two bodies have the mean of theirs", "m",
        'model = "particles"', default=None)


class _Body(_Named):
    file: ClassVar[None] = None
    spacing: Optional[Positive] = key("spacing of its particles, in the place of particles.spacing", "m", default=None)
    hole: Annotated[List[Hole], Listed] = key("shapes cut out of the body", default=[])


class _Region(ShapeTable):
    name: Name = key("name of the region")
    body: Optional[Name] = key("only particles of this body", default=None)


class BoxBody(BoxShape, _Body):
    """Box filled with a lattice."""


class DiskBody(DiskShape, _Body):
    """Disk filled with a lattice."""


class SphereBody(SphereShape, _Body):
    """Ball filled with a lattice."""


class CylinderBody(CylinderShape, _Body):
    """Cylinder filled with a lattice."""


class MeshBody(_Named):
    """Cells of a file."""

    shape: Literal["mesh"] = key("cells of a file: finite elements, or a particle each, at its centroid and with its volume")
    file: Optional[Text] = key(
        'file of triangles and quads, or of tetrahedra and hexahedra, that meshio reads, named from the folder of the scene; with model = "fem" [mesh] names it',
        default=None)
    group: Optional[Text] = key("physical group of the file that holds the body's cells (default: all cells)", default=None)
    hole: ClassVar[tuple] = ()
    spacing: ClassVar[None] = None


class TableBody(_Named):
    """Particles of a table."""

    shape: Literal["table"] = key("particles of a table")
    file: Text = key("text file, named from the folder of the scene: x y [z] volume block on each line, blanks or commas between, comments from # on", "m, m^3, 1")
    block: Optional[Integer] = key("only the rows of this block (default: all)", "1", default=None)
    hole: ClassVar[tuple] = ()
    spacing: ClassVar[None] = None


class BoxRegion(BoxShape, _Region):
    """Region in a box."""


class DiskRegion(DiskShape, _Region):
    """Region in a disk."""


class SphereRegion(SphereShape, _Region):
    """Region in a ball."""


class CylinderRegion(CylinderShape, _Region):
    """Region in a cylinder."""


class HalfSpaceRegion(HalfSpaceShape, _Region):
    """Region in a half space."""


class GroupRegion(ShapeTable):
    """Region that the file of a mesh or table names."""

    name: Name = key("name of the region")
    shape: Literal["group"] = key(
        "cells or boundary facets of a physical group of the file that [mesh] names; of bodies' files the particles whose cells are in the group, have one of its "
        "facets, or touch one of its points, or that are in the block of a table")
    group: Text = key("name of the physical group, or number of the block of a table")
    body: ClassVar[None] = None


class _Fine(ShapeTable):
    step_ratio: AutoOrRatio = key(
        'm, the number of steps of the fine region in one step of the rest; "auto": the smallest that meets its critical step and time.error', "1",
        "error of the shortest wave that a horizon resolves: (pi c dt/delta)^2/24", default="auto")
    overlap: Optional[Positive] = key("width of the overlap with the rest, beyond the shape, in horizons (default 1; lps 2)", "1", default=None)
    interface: Literal["auto", "exact", "polynomial", "kick"] = key(
        "how the velocity gap on the overlap is closed: exactly (CG on the linear response), by an operator of fixed cost, or by reflecting it; "
        "auto: polynomial up to the fine region's undivided critical step, else exact", "", "Lindsay, Parks & Prakash 2016; see README", default="auto")


class BoxFine(BoxShape, _Fine):
    """Fine region in a box."""


class DiskFine(DiskShape, _Fine):
    """Fine region in a disk."""


class SphereFine(SphereShape, _Fine):
    """Fine region in a ball."""


class CylinderFine(CylinderShape, _Fine):
    """Fine region in a cylinder."""


class BandFine(BandShape, _Fine):
    """Fine region along a polyline."""


Body = one_of([BoxBody, DiskBody, SphereBody, CylinderBody, MeshBody, TableBody], "shape")
Region = one_of([BoxRegion, DiskRegion, SphereRegion, CylinderRegion, HalfSpaceRegion, GroupRegion], "shape")
Fine = one_of([BoxFine, DiskFine, SphereFine, CylinderFine, BandFine], "shape")
