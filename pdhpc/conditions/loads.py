"""Loads and prescribed motions on sets of owned particles, with the work they do.

Over a step of velocity Verlet, du = dt v_half. A body force b does the work V (b_n + b_{n+1})/2 . du; holding a component to a prescribed motion does the
work d(kinetic) - V (f_n + f_{n+1})/2 du, f the total force density. Work is kept per particle, so that its sum over ranks can be made exact.
"""
import numpy as np

from pdhpc.jit import kernel


class BodyForce:
    """Force density `vector` f(t) on some particles; traction and gravity are given as force densities too."""

    def __init__(self, indices, vector, time_function):
        """indices (n,) int32, slots of owned particles; vector (n, dim), N/m^3, of each at f = 1; time_function as in time_functions.py."""
        self.indices = np.ascontiguousarray(indices, dtype=np.int32)
        self.vector = np.ascontiguousarray(vector, dtype=float)
        self.time_function = time_function
        self.work = np.zeros(len(self.indices))  # J/m^3, done on each particle so far

    def add_to(self, force_density, t):
        """Add the load at time t to force_density (n_slots, dim), N/m^3."""
        _add_load(force_density, self.indices, self.vector, self.time_function.value(t))

    def do_work(self, velocity, t, dt):
        """Account for the work over the step that ends at t; velocity (n_slots, dim) is that of the half step, m/s."""
        mean = 0.5 * (self.time_function.value(t - dt) + self.time_function.value(t))
        if mean != 0.0:
            _add_load_work(self.work, self.indices, self.vector, velocity, mean * dt)


class PrescribedMotion:
    """Displacement or velocity of chosen components, given as `value` f(t), of some particles."""

    def __init__(self, indices, components, value, time_function, quantity):
        """indices (n,) int32, slots of owned particles; components (c,) int; value (c,) or (n, c), m or m/s; quantity "displacement" or "velocity"."""
        self.indices = np.ascontiguousarray(indices, dtype=np.int32)
        self.components = np.ascontiguousarray(components, dtype=np.int64)
        value = np.asarray(value, dtype=float)
        self.value = np.ascontiguousarray(value if value.ndim == 2 else value[None])  # one row serves all particles, or each has its own
        self.time_function = time_function
        self.displaces = quantity == "displacement"
        self.work = np.zeros(len(self.indices))  # J/m^3, of the forces that hold the particles, without their kinetic energy
        self.initial_kinetic = np.zeros(len(self.indices))  # J/m^3
        self._target = np.empty_like(self.value)

    def velocity_at(self, t):
        """Return (1 or n, c) prescribed velocities of the components at time t, m/s."""
        scale = self.time_function.rate(t) if self.displaces else self.time_function.value(t)
        return self.value * scale

    def steer(self, displacement, velocity, t, dt):
        """Set the half-step velocity that carries the particles to where they must be at time t."""
        if self.displaces:
            np.multiply(self.value, self.time_function.value(t), out=self._target)
        else:
            np.multiply(self.value, dt * self.time_function.value(t - 0.5 * dt), out=self._target)
        _steer(displacement, velocity, self.indices, self.components, self._target, dt, self.displaces)

    def place(self, displacement, t, share):
        """Take prescribed displacements a share of the way to value f(t), the whole of it with 1."""
        np.multiply(self.value, self.time_function.value(t), out=self._target)
        _place(displacement, self.indices, self.components, self._target, share)

    def settle(self, velocity, t):
        """Set the velocity at the full step t."""
        _settle(velocity, self.indices, self.components, self.velocity_at(t))

    def do_work(self, force_density, velocity, dt):
        """Subtract the work of the total force density over half a step; called with the forces at both ends of the step and the half-step velocity."""
        _subtract_force_work(self.work, self.indices, self.components, force_density, velocity, 0.5 * dt)

    def kinetic(self, velocity, half_density):
        """Return (n,) kinetic energy density of the prescribed components, J/m^3; half_density (n,) is rho/2 of these particles, kg/m^3."""
        return half_density * np.square(velocity[self.indices][:, self.components]).sum(axis=1)


@kernel
def _add_load(force_density, indices, vector, scale):
    for n in range(len(indices)):
        for d in range(vector.shape[1]):
            force_density[indices[n], d] += scale * vector[n, d]


@kernel
def _add_load_work(work, indices, vector, velocity, factor):
    for n in range(len(indices)):
        for d in range(vector.shape[1]):
            work[n] += factor * vector[n, d] * velocity[indices[n], d]


@kernel
def _steer(displacement, velocity, indices, components, target, dt, absolute):
    for n in range(len(indices)):
        i = indices[n]
        for c in range(len(components)):
            d = components[c]
            goal = target[n % len(target), c]
            velocity[i, d] = (goal - displacement[i, d]) / dt if absolute else goal / dt


@kernel
def _place(displacement, indices, components, target, share):
    for n in range(len(indices)):
        i = indices[n]
        for c in range(len(components)):
            d = components[c]
            goal = target[n % len(target), c]
            displacement[i, d] = goal if share == 1.0 else displacement[i, d] + share * (goal - displacement[i, d])


@kernel
def _settle(velocity, indices, components, value):
    for n in range(len(indices)):
        for c in range(len(components)):
            velocity[indices[n], components[c]] = value[n % len(value), c]


@kernel
def _subtract_force_work(work, indices, components, force_density, velocity, factor):
    for n in range(len(indices)):
        for c in range(len(components)):
            work[n] -= factor * force_density[indices[n], components[c]] * velocity[indices[n], components[c]]
