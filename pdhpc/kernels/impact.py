"""Particles against a rigid impactor: penalty force, friction, and their exact sum.

Of a particle of radius a whose centre has the distance phi (negative inside) from the impactor's surface, e = a - phi > 0, n the surface's outward normal,
s the penalty stiffness (N/m^4) and w its half-step velocity relative to the impactor's:

    F = V s e n - T w_t/|w_t|,   T = min(friction V s e, m |w_t|/(4 dt)).
"""
from typing import NamedTuple

import numpy as np

from pdhpc.conditions.impactors import CYLINDER, PLANE
from pdhpc.jit import inlined, kernel
from pdhpc.parallel.exact import add_exactly


class Rigid(NamedTuple):
    """An impactor as kernels see it: kind; centre, axis, velocity (3,), m and m/s (z = 0 in 2D); radius, half_length, m; friction; dt, s."""

    kind: int
    centre: np.ndarray
    axis: np.ndarray
    velocity: np.ndarray
    radius: float
    half_length: float
    friction: float
    dt: float


class Struck(NamedTuple):
    """Particles near an impactor: slot (n,) int32; radius (n,), m; volume (n,), m^3; mass (n,), kg; stiffness (n,), N/m^4."""

    slot: np.ndarray
    radius: np.ndarray
    volume: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray


@inlined
def _surface(rigid, x, y, z):
    """Return (phi, nx, ny, nz): distance from the surface and its outward normal there."""
    if rigid.kind == PLANE:
        a = rigid.axis
        return (x - rigid.centre[0]) * a[0] + (y - rigid.centre[1]) * a[1] + (z - rigid.centre[2]) * a[2], a[0], a[1], a[2]
    x, y, z = x - rigid.centre[0], y - rigid.centre[1], z - rigid.centre[2]
    along, a = 0.0, rigid.axis
    if rigid.kind == CYLINDER:
        along = x * a[0] + y * a[1] + z * a[2]
        x, y, z = x - along * a[0], y - along * a[1], z - along * a[2]
    r = np.sqrt(x * x + y * y + z * z)
    side = r - rigid.radius
    nx, ny, nz = (x / r, y / r, z / r) if r > 0.0 else (1.0, 0.0, 0.0)
    if rigid.kind != CYLINDER or not rigid.half_length < np.inf:
        return side, nx, ny, nz
    end, sign = abs(along) - rigid.half_length, 1.0 if along >= 0.0 else -1.0
    if side > 0.0 and end > 0.0:  # nearest to the rim
        phi = np.sqrt(side * side + end * end)
        p, q = side / phi, sign * end / phi
        return phi, p * nx + q * a[0], p * ny + q * a[1], p * nz + q * a[2]
    if end > side:
        return end, sign * a[0], sign * a[1], sign * a[2]
    return side, nx, ny, nz


@kernel
def find_depths(rigid, points, radius, depth):
    """Store in depth (n,) how far balls of radius (n,) around points (n, dim), m, enter the impactor; negative where they keep apart."""
    for n in range(len(points)):
        phi, _, _, _ = _surface(rigid, points[n, 0], points[n, 1], points[n, 2] if points.shape[1] == 3 else 0.0)
        depth[n] = radius[n] - phi


@kernel
def find_near(rigid, position, dim, slots, radius, reach, near):
    """Mark in near (n,) bool the particles in `slots` (n,) of radius (n,), m, whose surface is within `reach`, m, of the impactor's."""
    for n in range(len(slots)):
        s = slots[n]
        phi, _, _, _ = _surface(rigid, position[s, 0], position[s, 1], position[s, 2] if dim == 3 else 0.0)
        near[n] = phi < radius[n] + reach


@kernel
def push(rigid, struck, position, velocity, force_density, applied, inelastic, given):
    """Add the impactor's force densities to force_density (n_slots, dim), N/m^3; store the forces, and friction's part, in applied and inelastic (n, dim), N.

    given : whether friction's part is to be taken as it stands there.
    """
    dim = force_density.shape[1]
    for t in range(len(struck.slot)):
        s = struck.slot[t]
        phi, nx, ny, nz = _surface(rigid, position[s, 0], position[s, 1], position[s, 2] if dim == 3 else 0.0)
        depth = struck.radius[t] - phi
        if not depth > 0.0:
            for d in range(dim):
                applied[t, d], inelastic[t, d] = 0.0, 0.0
            continue
        normal = struck.volume[t] * (struck.stiffness[t] * depth)
        wx, wy = velocity[s, 0] - rigid.velocity[0], velocity[s, 1] - rigid.velocity[1]
        wz = velocity[s, 2] - rigid.velocity[2] if dim == 3 else 0.0
        along = wx * nx + wy * ny + wz * nz
        tx, ty, tz = wx - along * nx, wy - along * ny, wz - along * nz
        slip = np.sqrt(tx * tx + ty * ty + tz * tz)
        drag = 0.0 if slip == 0.0 else min(rigid.friction * normal, struck.mass[t] * slip / (4.0 * rigid.dt)) / slip
        if not given:
            inelastic[t, 0], inelastic[t, 1] = -drag * tx, -drag * ty
        applied[t, 0], applied[t, 1] = normal * nx + inelastic[t, 0], normal * ny + inelastic[t, 1]
        if dim == 3:
            if not given:
                inelastic[t, 2] = -drag * tz
            applied[t, 2] = normal * nz + inelastic[t, 2]
        for d in range(dim):
            force_density[s, d] += applied[t, d] / struck.volume[t]


@kernel
def add_reaction(struck, applied, places):
    """Add minus the forces applied (n, dim), N, to the exact sums of the components, places (dim + 1, 21), and V s of the particles pushed to the last."""
    dim = applied.shape[1]
    for t in range(len(applied)):
        touched = False
        for d in range(dim):
            touched |= applied[t, d] != 0.0
            add_exactly(places[d], -applied[t, d])
        if touched:
            add_exactly(places[dim], struck.volume[t] * struck.stiffness[t])


@kernel
def stored(rigid, struck, position, dim, energy):
    """Store V s e^2/2, J, of the struck particles in energy (n,)."""
    for t in range(len(struck.slot)):
        s = struck.slot[t]
        phi, _, _, _ = _surface(rigid, position[s, 0], position[s, 1], position[s, 2] if dim == 3 else 0.0)
        depth = max(0.0, struck.radius[t] - phi)
        energy[t] = 0.5 * struck.volume[t] * (struck.stiffness[t] * depth) * depth


@kernel
def account(struck, number, applied, inelastic, velocity, rigid_velocity, half_dt, prescribed, work, loss):
    """Add the impactor's work over half a step on its particles to work (n_owned,), where it moves as prescribed, and what friction loses to loss (n_owned,), J.

    number (n,) : which owned particle each is. velocity (n_slots, dim), rigid_velocity (3,), m/s, of the half step.
    """
    for t in range(len(struck.slot)):
        done, lost = 0.0, 0.0
        for d in range(applied.shape[1]):
            done += applied[t, d] * rigid_velocity[d]
            lost -= inelastic[t, d] * (velocity[struck.slot[t], d] - rigid_velocity[d])
        loss[number[t]] += half_dt * lost
        if prescribed:
            work[number[t]] += half_dt * done
