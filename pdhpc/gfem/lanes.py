"""Loops over rows of eight particles of a lattice, some of which move: their motion, and sums between them and the functions of a mesh.

Fields by slot are (n_slots, dim), each component together; lanes of rows are numbered 8 t + l.
"""
import numpy as np

from pdhpc.jit import inlined, kernel, sweep
from pdhpc.kernels.simd import LANES, fma, load8, splat, store8


@sweep
def kick_drift(rows, velocity, force_density, inverse_density, position, half, tau):
    """v += half f / rho, u += tau v in rows of eight; inverse_density (n_slots,), m^3/kg, is 0 where a particle does not move, and v is."""
    n = len(position)
    for t in range(len(rows)):
        i = rows[t]
        factor = half * load8(inverse_density, i)
        for d in range(position.shape[1]):
            v = fma(factor, load8(force_density, d * n + i), load8(velocity, d * n + i))
            store8(velocity, d * n + i, v)
            store8(position, d * n + i, fma(splat(tau), v, load8(position, d * n + i)))


@sweep
def kick(rows, velocity, force_density, inverse_density, half):
    """v += half f / rho in rows of eight."""
    n = len(velocity)
    for t in range(len(rows)):
        i = rows[t]
        factor = half * load8(inverse_density, i)
        for d in range(velocity.shape[1]):
            store8(velocity, d * n + i, fma(factor, load8(force_density, d * n + i), load8(velocity, d * n + i)))


@sweep
def remember(rows, position, velocity, before, velocity_before):
    """Copy u and v of rows of eight to (n_rows, dim, 8) each."""
    n, dim = len(position), position.shape[1]
    for t in range(len(rows)):
        for d in range(dim):
            store8(before, LANES * (dim * t + d), load8(position, d * n + rows[t]))
            store8(velocity_before, LANES * (dim * t + d), load8(velocity, d * n + rows[t]))


@kernel
def place(slots, displacement, velocity, acceleration, t, position):
    """position[slots] = u + t v + t^2/2 a; u, v, a (n, dim)."""
    for d in range(displacement.shape[1]):
        for n in range(len(slots)):
            position[slots[n], d] = displacement[n, d] + t * (velocity[n, d] + 0.5 * t * acceleration[n, d])


@kernel
def blend_state(rows, inside, alpha, before, position, velocity, of_velocity):
    """Of the lanes inside enriched cells set u = u^n + alpha (U - u^n), or, where `of_velocity`, v = alpha V; alpha, inside (8 n_rows,)."""
    for t in range(len(rows)):
        for lane in range(8):
            a = alpha[8 * t + lane]
            if inside[8 * t + lane] and a < 1.0:
                i = rows[t] + lane
                for d in range(position.shape[1]):
                    if of_velocity:
                        velocity[i, d] = a * velocity[i, d]
                    else:
                        position[i, d] = before[t, d, lane] + a * (position[i, d] - before[t, d, lane])


@kernel
def project_displacement(rows, lane_cell, number, shape, alpha, inside, before, velocity_before, moment, position, density, dt, volume, cells, acting, result):
    """result += sum_p V_p N_i (dt rho v^n + I2 - rho alpha (U - u^n)) inside enriched cells, sum_p V_p N_i I2 outside; density (8 n_rows,), kg/m^3.

    2D; shape (n_points, 8), the four functions of a quad and zeros. Lanes of a cell that follow each other are summed up before they are added.
    """
    scratch, last, x, y = np.zeros(2 * LANES), -1, splat(0.0), splat(0.0)
    for t in range(len(rows)):
        for lane in range(LANES):
            n = LANES * t + lane
            if lane_cell[n] != last:
                _flush(cells, last, x, y, scratch, acting, result)
                last, x, y = lane_cell[n], splat(0.0), splat(0.0)
            if last < 0:
                continue
            i, fx, fy = rows[t] + lane, moment[t, 0, lane], moment[t, 1, lane]
            if inside[n]:
                fx += density[n] * (dt * velocity_before[t, 0, lane] - alpha[n] * (position[i, 0] - before[t, 0, lane]))
                fy += density[n] * (dt * velocity_before[t, 1, lane] - alpha[n] * (position[i, 1] - before[t, 1, lane]))
            functions = load8(shape, LANES * np.int64(number[n]))
            x, y = fma(splat(volume * fx), functions, x), fma(splat(volume * fy), functions, y)
    _flush(cells, last, x, y, scratch, acting, result)


@kernel
def project_velocity(rows, lane_cell, number, shape, alpha, inside, velocity_before, impulse, velocity, density, volume, cells, acting, result):
    """result += sum_p V_p N_i (rho v^n + I1 - rho alpha V) inside enriched cells, sum_p V_p N_i I1 outside; see project_displacement."""
    scratch, last, x, y = np.zeros(2 * LANES), -1, splat(0.0), splat(0.0)
    for t in range(len(rows)):
        for lane in range(LANES):
            n = LANES * t + lane
            if lane_cell[n] != last:
                _flush(cells, last, x, y, scratch, acting, result)
                last, x, y = lane_cell[n], splat(0.0), splat(0.0)
            if last < 0:
                continue
            i, fx, fy = rows[t] + lane, impulse[t, 0, lane], impulse[t, 1, lane]
            if inside[n]:
                fx += density[n] * (velocity_before[t, 0, lane] - alpha[n] * velocity[i, 0])
                fy += density[n] * (velocity_before[t, 1, lane] - alpha[n] * velocity[i, 1])
            functions = load8(shape, LANES * np.int64(number[n]))
            x, y = fma(splat(volume * fx), functions, x), fma(splat(volume * fy), functions, y)
    _flush(cells, last, x, y, scratch, acting, result)


@inlined
def _flush(cells, cell, x, y, scratch, acting, result):
    """Add the sums of one cell's corners, in the first lanes of x and y, to result (n_vertices, 2); those of corners that do not act go to the ones that do."""
    if cell >= 0:
        store8(scratch, 0, x)
        store8(scratch, LANES, y)
        left_x, left_y, count = 0.0, 0.0, 0
        for a in range(cells.shape[1]):
            if acting[cells[cell, a]]:
                count += 1
            else:
                left_x += scratch[a]
                left_y += scratch[LANES + a]
        if count:
            left_x, left_y = left_x / count, left_y / count
            for a in range(cells.shape[1]):
                if acting[cells[cell, a]]:
                    result[cells[cell, a], 0] += scratch[a] + left_x
                    result[cells[cell, a], 1] += scratch[LANES + a] + left_y


@kernel
def lump(cells, chosen, kind, lumped, result):
    """result (n_vertices,) += row sums of the masses of cells chosen (n,), kg."""
    for n in range(len(chosen)):
        corner, m = cells[chosen[n]], lumped[kind[chosen[n]]]
        for a in range(len(corner)):
            result[corner[a]] += m[a]
