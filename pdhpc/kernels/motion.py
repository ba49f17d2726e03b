"""Updates of velocities, displacements and positions: one pass over the particles each, no temporaries.

Fields of a cloud are (n, dim) with the components of a particle together; those of a lattice (dim, n_slots) with a component of all slots together, and its
passes run over the cells that the rank owns, empty ones too: there forces and velocities are zero and stay so.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import inlined, kernel, sweep
from pdhpc.kernels.simd import LANES, fma, load8, splat, store8


@kernel
def place(reference, displacement, position, linear):
    """Store X + u (finite) or u (linear), m, of owned particles in position (n, width)."""
    for i in range(len(displacement)):
        for d in range(displacement.shape[1]):
            position[i, d] = displacement[i, d] if linear is not None else reference[i, d] + displacement[i, d]


@kernel
def kick(velocity, force_density, inverse_density, block, dt):
    """v += dt f / rho; velocity, force_density (n_owned, dim); inverse_density (256,), m^3/kg, by block."""
    for i in range(len(velocity)):
        factor = dt * inverse_density[block[i]]
        for d in range(velocity.shape[1]):
            velocity[i, d] = fma(factor, force_density[i, d], velocity[i, d])


@kernel
def drift(displacement, velocity, reference, position, linear, dt):
    """u += dt v; position = X + u (finite) or u (linear)."""
    for i in range(len(displacement)):
        for d in range(displacement.shape[1]):
            displacement[i, d] = fma(dt, velocity[i, d], displacement[i, d])
            position[i, d] = displacement[i, d] if linear is not None else reference[i, d] + displacement[i, d]


@kernel
def kick_drift(velocity, force_density, inverse_density, block, displacement, reference, position, linear, half, dt):
    """`kick` by `half` and `drift` by `dt`, s, in one pass."""
    for i in range(len(velocity)):
        factor = half * inverse_density[block[i]]
        for d in range(velocity.shape[1]):
            velocity[i, d] = fma(factor, force_density[i, d], velocity[i, d])
            displacement[i, d] = fma(dt, velocity[i, d], displacement[i, d])
            position[i, d] = displacement[i, d] if linear is not None else reference[i, d] + displacement[i, d]


class Rows(NamedTuple):
    """The cells that a rank owns of a lattice, as rows along the grid's fastest axis.

    start (n_rows,) int64, first slot of each; width, number of slots; axis, x, y or z, that they run along; along (width,), m, coordinates of their cells;
    corner (n_rows, dim), m, coordinates of each row across it; one_density: all blocks share it.
    """

    start: np.ndarray
    width: int
    axis: int
    along: np.ndarray
    corner: np.ndarray
    one_density: bool


@sweep
def place_rows(rows, displacement, position, linear):
    """`place` of a lattice; displacement, position (dim, n_slots)."""
    for row in range(len(rows.start)):
        for d in range(len(displacement)):
            _place_row(rows, row, d, displacement[d], position[d], linear)


@sweep
def kick_rows(rows, velocity, force_density, inverse_density, block, dt):
    """`kick` of a lattice; velocity, force_density (dim, n_slots)."""
    for row in range(len(rows.start)):
        for d in range(len(velocity)):
            _kick_row(rows, row, velocity[d], force_density[d], inverse_density, block, dt)


@sweep
def drift_rows(rows, displacement, velocity, position, linear, dt):
    """`drift` of a lattice; all fields (dim, n_slots)."""
    for row in range(len(rows.start)):
        for d in range(len(displacement)):
            _drift_row(rows, row, displacement[d], velocity[d], dt)
            _place_row(rows, row, d, displacement[d], position[d], linear)


@sweep
def kick_drift_rows(rows, velocity, force_density, inverse_density, block, displacement, position, linear, half, dt):
    """`kick_rows` by `half` and `drift_rows` by `dt`, s: row by row, so that each row stays in the cache from one to the other."""
    for row in range(len(rows.start)):
        for d in range(len(velocity)):
            _kick_row(rows, row, velocity[d], force_density[d], inverse_density, block, half)
            _drift_row(rows, row, displacement[d], velocity[d], dt)
            _place_row(rows, row, d, displacement[d], position[d], linear)


@inlined
def _add_scaled(target, factor, source, first, last):
    """target += factor * source from slot `first` to `last`, eight at a time and the rest one by one, to the same bits."""
    i = first
    while i + LANES <= last:
        store8(target, i, fma(splat(factor), load8(source, i), load8(target, i)))
        i += LANES
    while i < last:
        target[i] = fma(factor, source[i], target[i])
        i += 1


@inlined
def _kick_row(rows, row, velocity, force_density, inverse_density, block, dt):
    """v += dt f / rho of one component of one row."""
    first, last = rows.start[row], rows.start[row] + rows.width
    if rows.one_density:
        _add_scaled(velocity, dt * inverse_density[0], force_density, first, last)
    else:
        for i in range(first, last):
            velocity[i] = fma(dt * inverse_density[block[i]], force_density[i], velocity[i])


@inlined
def _drift_row(rows, row, displacement, velocity, dt):
    """u += dt v of one component of one row."""
    _add_scaled(displacement, dt, velocity, rows.start[row], rows.start[row] + rows.width)


@inlined
def _place_row(rows, row, d, displacement, position, linear):
    """position = X + u or u of one component of one row."""
    first, last = rows.start[row], rows.start[row] + rows.width
    corner = 0.0 if linear is not None else rows.corner[row, d]  # 0 along the row
    i, along = first, rows.along
    if d == rows.axis and linear is None:
        while i + LANES <= last:
            store8(position, i, load8(along, i - first) + load8(displacement, i))
            i += LANES
        while i < last:
            position[i] = along[i - first] + displacement[i]
            i += 1
        return
    while i + LANES <= last:
        store8(position, i, corner + load8(displacement, i))
        i += LANES
    while i < last:
        position[i] = corner + displacement[i]
        i += 1


@sweep
def kick_by_mass(velocity, force, inverse_mass, dt):
    """v += dt f / m of all slots; velocity, force (dim, n_slots), n_slots a multiple of 8; inverse_mass (n_slots,), 1/kg, 0 where nothing moves."""
    for d in range(len(velocity)):
        for i in range(0, len(inverse_mass), LANES):
            store8(velocity[d], i, fma(dt * load8(inverse_mass, i), load8(force[d], i), load8(velocity[d], i)))


@sweep
def kick_drift_by_mass(velocity, force, inverse_mass, displacement, half, dt):
    """`kick_by_mass` by `half` and u += dt v, in one pass."""
    for d in range(len(velocity)):
        for i in range(0, len(inverse_mass), LANES):
            v = fma(half * load8(inverse_mass, i), load8(force[d], i), load8(velocity[d], i))
            store8(velocity[d], i, v)
            store8(displacement[d], i, fma(splat(dt), v, load8(displacement[d], i)))


@sweep
def drift_by_mass(displacement, velocity, dt):
    """u += dt v of all slots; (dim, n_slots), n_slots a multiple of 8."""
    for d in range(len(velocity)):
        _add_scaled(displacement[d], dt, velocity[d], 0, velocity.shape[1])


@kernel
def first_not_finite(field, slots):
    """Return the first n whose particle slots[n] has a NaN or an infinity in field (n_slots, width), or -1."""
    for n in range(len(slots)):
        total = 0.0
        for d in range(field.shape[1]):
            total += field[slots[n], d] * 0.0
        if total != 0.0:
            return n
    return -1


@kernel
def kinetic_energies(velocity, volume, block, density, slots, energy):
    """Store rho V v^2 / 2, J, of the particles in `slots` (n,) in energy (n,)."""
    for n in range(len(slots)):
        i, square = slots[n], 0.0
        for d in range(velocity.shape[1]):
            square += velocity[i, d] * velocity[i, d]
        energy[n] = 0.5 * density[block[i]] * volume[i] * square
