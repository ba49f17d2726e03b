"""Loads, prescribed motions, their time functions, and initial states as tables of the scene."""
from typing import Literal, Optional

from pdhpc.scene.fields import (
    FreeVector, Matrix, Name, NotNegative, Number, Numbers, Positive, Rule, Table, Vector, check_direction, check_vector, key,
)
from pdhpc.scene.shapes import one_of

ABOUT_AXIS = ("radial_velocity", "axial_velocity", "angular_velocity")
Z_AXIS = (0.0, 0.0, 1.0)


class _Time(Table):
    def check(self):
        """Raise a Rule when the function is impossible."""


class ConstantTime(_Time):
    """f = 1."""

    function: Literal["constant"] = key("time function", "", "f = 1", default="constant")


class RampTime(_Time):
    """f from 0 to 1."""

    function: Literal["ramp"] = key("time function", "", "f = 0 before start, (t - start)/(end - start), 1 after end")
    start: NotNegative = key("start of the ramp", "s", default=0.0)
    end: Positive = key("end of the ramp", "s")

    def check(self):
        """Raise a Rule unless start < end."""
        if self.end <= self.start:
            raise Rule("time.end", self.end, f"a time after time.start = {self.start}")


class SineTime(_Time):
    """f = sin(2 pi frequency t + phase)."""

    function: Literal["sine"] = key("time function", "", "f = sin(2 pi frequency t + phase)")
    frequency: Positive = key("frequency", "Hz")
    phase: Number = key("phase", "rad", default=0.0)


class TableTime(_Time):
    """f through given points."""

    function: Literal["table"] = key("time function", "", "f linear between (times, values), constant outside")
    times: Numbers = key("times, increasing", "s")
    values: Numbers = key("values of f", "1")

    def check(self):
        """Raise a Rule unless times increase and match the values."""
        if len(self.times) < 2 or any(b <= a for a, b in zip(self.times[:-1], self.times[1:])):
            raise Rule("time.times", self.times, "at least two times, each after the one before")
        if len(self.values) != len(self.times):
            raise Rule("time.values", f"{len(self.values)} values", f"as many values as times ({len(self.times)})")


Time = one_of([ConstantTime, RampTime, SineTime, TableTime], "function")


class _Load(Table):
    name: Optional[Name] = key("name of the load", default=None)
    type: str
    region: Name = key("region it acts on")
    value: Vector
    time: Time = key("time function f(t) that scales the value (default: constant)", default=ConstantTime())

    def check(self, dim):
        """Raise a Rule for a value or a time function that is impossible in `dim` dimensions."""
        check_vector("value", self.value, dim)
        self.time.check()


class _Motion(_Load):
    def check(self, dim):
        """Raise a Rule when every component is free too."""
        super().check(dim)
        if all(component == "free" for component in self.value):
            raise Rule("value", self.value, "at least one component that is a number")


class DisplacementLoad(_Motion):
    """Prescribed displacement."""

    type: Literal["displacement"] = key("prescribed displacement", "", "u = value f(t)")
    value: FreeVector = key('components, each a number or "free"', "m")


class VelocityLoad(_Motion):
    """Prescribed velocity."""

    type: Literal["velocity"] = key("prescribed velocity", "", "v = value f(t)")
    value: FreeVector = key('components, each a number or "free"', "m/s")


class ForceDensityLoad(_Load):
    """Force per volume."""

    type: Literal["force_density"] = key("force per volume", "", "b = value f(t)")
    value: Vector = key("components", "N/m^3")


class TractionLoad(_Load):
    """Force per area of a face of a region."""

    type: Literal["traction"] = key(
        "force per area: of the facets of cells, or spread evenly over the volume of a region of particles", "",
        "particles: b = value f(t) A/V, A the area of the face, V the region's volume")
    region: Name = key("region it acts on: the layer of particles below the face, or what holds the facets")
    face: Optional[Literal["+x", "-x", "+y", "-y", "+z", "-z"]] = key("outward normal of the loaded face; all facets of a physical group without", default=None)
    value: Vector = key("components", "Pa")

    def check(self, dim):
        """Raise a Rule for a z face in 2D too."""
        super().check(dim)
        if dim == 2 and self.face is not None and self.face[1] == "z":
            raise Rule("face", f'"{self.face}"', '"+x", "-x", "+y" or "-y" in 2D')


class GravityLoad(_Load):
    """Acceleration of gravity."""

    type: Literal["gravity"] = key("acceleration of gravity", "", "b = density value f(t)")
    region: Name = key("region it acts on", default="all")
    value: Vector = key("components", "m/s^2")


Load = one_of([DisplacementLoad, VelocityLoad, ForceDensityLoad, TractionLoad, GravityLoad], "type")


class Initial(Table):
    """Initial state of a region: u = displacement + displacement_gradient (x - origin), likewise for the velocity, and what it has about an axis."""

    region: Name = key("region it holds for", default="all")
    displacement: Optional[Vector] = key("uniform displacement u0", "m", "u = u0 + G (x - origin)", default=None)
    displacement_gradient: Optional[Matrix] = key("rows of the displacement gradient G", "1", "u = u0 + G (x - origin)", default=None)
    velocity: Optional[Vector] = key("uniform velocity v0", "m/s", "v = v0 + G (x - origin)", default=None)
    velocity_gradient: Optional[Matrix] = key("rows of the velocity gradient G", "1/s", "v = v0 + G (x - origin)", default=None)
    radial_velocity: Optional[Numbers] = key(
        "coefficients c0, c1, ... of the velocity away from an axis through the origin, 0 on it; z: place along the axis, 0 in 2D", "m/s",
        "v_r = sum_k c_k (z/length)^k", default=None)
    axial_velocity: Optional[Numbers] = key("coefficients of the velocity along the axis, 3D", "m/s", "v_z = sum_k c_k (z/length)^k", default=None)
    angular_velocity: Optional[Numbers] = key(
        "coefficients of the angular velocity about the axis, counterclockwise", "rad/s", "v = w a x (x - origin), w = sum_k c_k (z/length)^k", default=None)
    axis: Optional[Vector] = key("direction a of the axis, of any length, 3D (default z)", "1", default=None)
    length: Optional[Positive] = key("length that z is measured in (default 1 m)", "m", default=None)
    origin: Optional[Vector] = key("point where the gradients' part is zero, on the axis with z = 0 (default: the origin of the coordinates)", "m", default=None)

    def check(self, dim):
        """Raise a Rule for wrong sizes or when nothing is given."""
        for name in ("displacement", "velocity", "origin"):
            check_vector(name, getattr(self, name), dim)
        self._check_axis(dim)
        for name in ("displacement_gradient", "velocity_gradient"):
            rows = getattr(self, name)
            if rows is not None and (len(rows) != dim or any(len(row) != dim for row in rows)):
                raise Rule(name, rows, f"{dim} rows of {dim} numbers")
        names = ("displacement", "displacement_gradient", "velocity", "velocity_gradient", *ABOUT_AXIS)
        if all(getattr(self, name) is None for name in names):
            raise Rule("displacement", "nothing", f"at least one of {', '.join(names)}")

    def _check_axis(self, dim):
        """Raise a Rule for what an axis cannot have in `dim` dimensions, or that nothing uses."""
        given = [name for name in ABOUT_AXIS if getattr(self, name) is not None]
        for name in ("axis", "length"):
            if getattr(self, name) is not None and not given:
                raise Rule(name, getattr(self, name), f"none without {', '.join(ABOUT_AXIS[:2])} or {ABOUT_AXIS[2]}")
        if dim == 3:
            check_direction("axis", self.axis, dim)
            return
        for name in ("axis", "axial_velocity", "length"):
            if getattr(self, name) is not None:
                raise Rule(name, getattr(self, name), "none in 2D: the axis points out of the plane, where z = 0")
        for name in given:
            if len(getattr(self, name)) > 1:
                raise Rule(name, getattr(self, name), "one number in 2D, where z = 0")

    def about_axis(self, dim):
        """Return the AxialMotion, None where there is none."""
        from pdhpc.conditions.axial_motion import AxialMotion  # needs numpy, which reading a scene does not

        radial, axial, angular = (tuple(getattr(self, name) or ()) for name in ABOUT_AXIS)
        if not (radial or axial or angular):
            return None
        return AxialMotion(tuple(self.origin or [0.0] * dim), tuple(self.axis or Z_AXIS), self.length or 1.0, radial, axial, angular)
