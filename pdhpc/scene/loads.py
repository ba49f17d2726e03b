"""Loads, prescribed motions, their time functions, and initial states as tables of the scene."""
from typing import Annotated, List, Literal, Optional

from pydantic import BeforeValidator

from pdhpc.scene.fields import Matrix, Name, NotNegative, Number, Numbers, Positive, Rule, Table, Vector, _list, check_vector, free_or_number, key
from pdhpc.scene.shapes import one_of

FreeVector = Annotated[List[Annotated[object, BeforeValidator(free_or_number)]], BeforeValidator(_list)]


class ConstantTime(Table):
    """f = 1."""

    function: Literal["constant"] = key("f = 1", default="constant")


class RampTime(Table):
    """f from 0 to 1."""

    function: Literal["ramp"] = key("f = 0 before start, 1 after end, linear between")
    start: NotNegative = key("start of the ramp", "s", default=0.0)
    end: Positive = key("end of the ramp", "s")

    def check(self, dim):
        """Raise a Rule unless start < end."""
        if self.end <= self.start:
            raise Rule("time.end", self.end, f"a time after time.start = {self.start}")


class SineTime(Table):
    """f = sin(2 pi frequency t + phase)."""

    function: Literal["sine"] = key("f = sin(2 pi frequency t + phase)")
    frequency: Positive = key("frequency", "Hz")
    phase: Number = key("phase", "rad", default=0.0)


class TableTime(Table):
    """f through given points."""

    function: Literal["table"] = key("f linear between (times, values), constant outside")
    times: Numbers = key("times, increasing", "s")
    values: Numbers = key("values of f")

    def check(self, dim):
        """Raise a Rule unless times increase and match the values."""
        if len(self.times) < 2 or any(b <= a for a, b in zip(self.times[:-1], self.times[1:])):
            raise Rule("time.times", self.times, "at least two times, each after the one before")
        if len(self.values) != len(self.times):
            raise Rule("time.values", f"{len(self.values)} values", f"as many values as times ({len(self.times)})")


Time = one_of([ConstantTime, RampTime, SineTime, TableTime], "function")


class _Load(Table):
    name: Optional[Name] = key("name of the load", default=None)
    time: Time = key("time function f(t) that scales the value", default=ConstantTime())

    def check(self, dim):
        """Raise a Rule for a value that does not fit the dimension."""
        check_vector("value", self.value, dim)
        if all(x == "free" for x in self.value):
            raise Rule("value", self.value, "at least one component that is a number")
        if hasattr(self.time, "check"):
            self.time.check(dim)


class DisplacementLoad(_Load):
    """Prescribed displacement."""

    type: Literal["displacement"] = key("prescribed displacement u = value f(t)")
    region: Name = key("region it acts on")
    value: FreeVector = key('components, each a number or "free"', "m")


class VelocityLoad(_Load):
    """Prescribed velocity."""

    type: Literal["velocity"] = key("prescribed velocity v = value f(t)")
    region: Name = key("region it acts on")
    value: FreeVector = key('components, each a number or "free"', "m/s")


class ForceDensityLoad(_Load):
    """Force per volume."""

    type: Literal["force_density"] = key("force per volume b = value f(t)")
    region: Name = key("region it acts on")
    value: Vector = key("components", "N/m^3")


class TractionLoad(_Load):
    """Force per area of a face of a region."""

    type: Literal["traction"] = key("force per area, spread evenly over the region's volume", source="b = value A / V, A the area of the face, V the region's volume")
    region: Name = key("region it acts on: the layer of particles below the face")
    face: Literal["+x", "-x", "+y", "-y", "+z", "-z"] = key("outward normal of the loaded face")
    value: Vector = key("components", "Pa")

    def check(self, dim):
        """Raise a Rule for a z face in 2D."""
        super().check(dim)
        if dim == 2 and self.face[1] == "z":
            raise Rule("face", f'"{self.face}"', "+x, -x, +y or -y in 2D")


class GravityLoad(_Load):
    """Acceleration of gravity."""

    type: Literal["gravity"] = key("acceleration, b = density value f(t)")
    region: Name = key("region it acts on", default="all")
    value: Vector = key("components", "m/s^2")


Load = one_of([DisplacementLoad, VelocityLoad, ForceDensityLoad, TractionLoad, GravityLoad], "type")


class Initial(Table):
    """Initial state of a region: u = displacement + displacement_gradient (x - origin), likewise for the velocity."""

    region: Name = key("region it holds for", default="all")
    displacement: Optional[Vector] = key("uniform displacement", "m", default=None)
    displacement_gradient: Optional[Matrix] = key("rows G of u = G (x - origin)", "1", default=None)
    velocity: Optional[Vector] = key("uniform velocity", "m/s", default=None)
    velocity_gradient: Optional[Matrix] = key("rows G of v = G (x - origin)", "1/s", default=None)
    origin: Optional[Vector] = key("point where the gradients' part is zero (default: the coordinates' origin)", "m", default=None)

    def check(self, dim):
        """Raise a Rule for wrong sizes or when nothing is given."""
        for name in ("displacement", "velocity", "origin"):
            check_vector(name, getattr(self, name), dim)
        for name in ("displacement_gradient", "velocity_gradient"):
            rows = getattr(self, name)
            if rows is not None and (len(rows) != dim or any(len(row) != dim for row in rows)):
                raise Rule(name, rows, f"{dim} rows of {dim} numbers")
        if all(getattr(self, name) is None for name in ("displacement", "displacement_gradient", "velocity", "velocity_gradient")):
            raise Rule("displacement", "nothing", "at least one of displacement, displacement_gradient, velocity, velocity_gradient")
