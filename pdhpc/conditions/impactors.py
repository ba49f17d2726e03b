"""Rigid impactors: where they are, how they move, and the energy that they hold. They do not rotate."""
import numpy as np

from pdhpc import state

SPHERE, CYLINDER, PLANE = 0, 1, 2


class Impactor:
    """A rigid body that moves as prescribed, or freely under the reaction of what it hits: velocity Verlet, M v' = R + M g.

        prescribed:  x_{n+1} = x_n + dt v f(t_n + dt/2)
        free:        v_{n+1/2} = v_n + dt/2 (R_n/M + g),  x_{n+1} = x_n + dt v_{n+1/2},  v_{n+1} = v_{n+1/2} + dt/2 (R_{n+1}/M + g)

    Attributes
    ----------
    kind : SPHERE, CYLINDER (infinite where half_length is) or PLANE (the half space behind it). radius, half_length : m.
    axis : (3,), unit vector of a cylinder, or the outward normal of a plane. mass : kg, infinite where the motion is prescribed.
    position : (dim,), m, of the centre or of a point of the plane. velocity : (dim,), m/s, of the half step inside a step. force : (dim,), N, of the body on it.
    travelled : (dim,), m, in the last step. gravity_work : J.
    """

    def __init__(self, name, shape, position, velocity, time_function, mass=np.inf, gravity=None):
        """shape : (kind, axis, radius, half_length). velocity : m/s, initial, or times the time function f where the mass is infinite. gravity : (dim,), m/s^2."""
        self.name = name
        self.kind, axis, self.radius, self.half_length = shape
        self.position, self.velocity = np.array(position, float), np.array(velocity, float)
        dim = len(self.position)
        self.axis = np.zeros(3)
        self.axis[: len(axis)] = axis
        self.mass, self.time_function, self._scaled = float(mass), time_function, self.velocity.copy()
        self.gravity = np.zeros(dim) if gravity is None else np.array(gravity, float)
        self.force, self.travelled, self.gravity_work, self.time = np.zeros(dim), np.zeros(dim), 0.0, 0.0
        if not self.free:
            self.velocity[:] = self._scaled * time_function.value(0.0)

    @property
    def free(self):
        """Whether it moves under the forces on it."""
        return np.isfinite(self.mass)

    @property
    def kinetic_energy(self):
        """J; 0 where the motion is prescribed."""
        return 0.5 * self.mass * float(self.velocity @ self.velocity) if self.free else 0.0

    def move(self, dt):
        """Take the position to the end of the step, and the velocity to its middle."""
        if self.free:
            self.velocity += 0.5 * dt * (self.force / self.mass + self.gravity)
        else:
            self.velocity[:] = self._scaled * self.time_function.value(self.time + 0.5 * dt)
        np.multiply(self.velocity, dt, out=self.travelled)
        self.position += self.travelled
        self.time += dt
        if self.free:
            self.gravity_work += self.mass * float(self.gravity @ self.travelled)

    def settle(self, dt):
        """Take the velocity to the end of the step, after the force there is known."""
        if self.free:
            self.velocity += 0.5 * dt * (self.force / self.mass + self.gravity)
        else:
            self.velocity[:] = self._scaled * self.time_function.value(self.time)

    def state(self):
        """Return {key: Entry} of what a continued run needs."""
        entries = {key: state.whole(getattr(self, key)) for key in ("position", "velocity", "force", "travelled")}
        entries.update({key: state.number(self, key) for key in ("gravity_work", "time")})
        return {f"impactor/{self.name}/{key}": entry for key, entry in entries.items()}
