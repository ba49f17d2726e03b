"""Contact between particles and rigid impactors as tables of the scene."""
from typing import Literal, Optional

from pdhpc.scene.fields import AutoOrPositive, Name, NotNegative, Positive, Rule, Table, Vector, check_direction, check_vector, key
from pdhpc.scene.loads import Time
from pdhpc.scene.shapes import one_of, only_in


class Contact(Table):
    """Short-range repulsion of particles that no intact bond joins: of several bodies, and of fragments."""

    distance: AutoOrPositive = key(
        'distance below which two particles repel, where they are not nearer in the unloaded body: d = min(0.9 |X_j - X_i|, distance); "auto": by their sizes', "m",
        "auto: 1.35 (a_i + a_j), a half the side of a particle's cell, so 1.35 h; Parks et al. 2008 (LAMMPS peri)", default="auto")
    stiffness: AutoOrPositive = key(
        "micromodulus c_s of the repulsion f = c_s (d - r)/horizon per volume of the other; two materials: harmonic mean, at the mean horizon of both bodies", "N/m^6",
        "auto: 15 times 18 K/(pi delta^4) in 3D, 9 E/(pi t delta^3) in plane stress, 48 E/(5 pi t delta^3) in plane strain; Parks et al. 2008", default="auto")
    friction: NotNegative = key(
        "Coulomb coefficient mu", "1", "T = min(mu N, m |w_t|/(4 dt)) against the sliding w_t, m = m_i m_j/(m_i + m_j)", default=0.0)
    damping: NotNegative = key(
        "damping ratio zeta of a pair along its normal, at most 0.5; adhesion is left out", "1", "N = max(0, k (d - r) - 2 zeta sqrt(k m) w_n); Cundall & Strack 1979",
        default=0.0)


class _Impactor(Table):
    name: Name = key("name of the impactor: of its columns in history.csv")
    velocity: Optional[Vector] = key("velocity (default 0): times the time function, or with a mass the initial one", "m/s", default=None)
    time: Optional[Time] = key("time function f(t) that scales a prescribed velocity (default: constant)", default=None)
    mass: Optional[Positive] = key("mass of an impactor that moves freely, without rotating (2D: over the thickness); none: the velocity is prescribed", "kg",
                                   "M v' = R + M g, R minus the sum of its forces on particles", default=None)
    gravity: Optional[Vector] = key("acceleration of gravity on a free impactor (default 0)", "m/s^2", default=None)
    stiffness: AutoOrPositive = key(
        "penalty s: force per volume of a particle and per depth e to which the particle, a ball of half the side h of its cell, enters", "N/m^4",
        "F = V s e; auto: E/h^2, as stiff as a layer of the particle's material of its thickness", default="auto")
    friction: NotNegative = key("Coulomb coefficient mu", "1", "T = min(mu V s e, m |w_t|/(4 dt)) against the sliding w_t", default=0.0)

    @property
    def place(self):
        """Where it is at the start, m."""
        return self.center

    def check(self, dim):
        """Raise a Rule for a vector of the wrong size, or for keys that only a free or only a prescribed impactor has."""
        for word in ("velocity", "gravity"):
            check_vector(word, getattr(self, word), dim)
        if self.time is not None:
            self.time.check()
        if self.mass is None and self.gravity is not None:
            raise Rule("gravity", self.gravity, "no such key without a mass: the velocity is prescribed")
        if self.mass is not None and self.time is not None:
            raise Rule("time", "a table", "no such key with a mass: only a prescribed velocity follows a time function")


class SphereImpactor(_Impactor):
    """Rigid sphere, 3D."""

    shape: Literal["sphere"] = key("rigid sphere, 3D")
    center: Vector = key("centre at the start", "m")
    radius: Positive = key("radius", "m")

    def check(self, dim):
        """Raise a Rule in 2D too."""
        only_in(3, dim, "shape", "sphere", '"cylinder" or "plane"')
        check_vector("center", self.center, dim)
        super().check(dim)


class CylinderImpactor(_Impactor):
    """Rigid cylinder: infinite along its axis, or with flat ends."""

    shape: Literal["cylinder"] = key("rigid cylinder: of `length` with flat ends, infinite without; in 2D a disk, the cylinder across the plane")
    center: Vector = key("centre, or a point on the axis, at the start", "m")
    radius: Positive = key("radius", "m")
    axis: Optional[Vector] = key("direction of the axis, 3D only", "1", default=None)
    length: Optional[Positive] = key("length between the flat ends, 3D only (default: infinite)", "m", default=None)

    def check(self, dim):
        """Raise a Rule for an axis in 2D, or for none in 3D."""
        check_vector("center", self.center, dim)
        for word in ("axis", "length"):
            if dim == 2 and getattr(self, word) is not None:
                raise Rule(word, getattr(self, word), "no such key in 2D, where the axis stands across the plane")
        if dim == 3 and self.axis is None:
            raise Rule("axis", "nothing", "a direction such as [0.0, 0.0, 1.0] in 3D")
        check_direction("axis", self.axis, dim)
        super().check(dim)


class PlaneImpactor(_Impactor):
    """Rigid half space."""

    shape: Literal["plane"] = key("rigid half space behind a plane (2D: a line)")
    point: Vector = key("point of the plane at the start", "m")
    normal: Vector = key("outward normal, towards the bodies, of any length", "1")

    @property
    def place(self):
        """A point of the plane at the start, m."""
        return self.point

    def check(self, dim):
        """Raise a Rule for a zero normal too."""
        check_vector("point", self.point, dim)
        check_direction("normal", self.normal, dim)
        super().check(dim)


Impactor = one_of([SphereImpactor, CylinderImpactor, PlaneImpactor], "shape")
