"""Forces on the vertices of a grid of equal cells: a stencil of assembled dim x dim blocks, eight vertices along the fastest axis at once.

A vertex has one of a few surroundings (which kinds of cells stand at its corners, or none); each has its stencil, and vertices with the same one that lie next
to each other make a run. A vertex's force is the same sequence of fused operations wherever it stands in a run, so it has the same bits on any rank.
"""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import sweep
from pdhpc.kernels.simd import LANES, at, fma, load8, splat, store8


class Runs(NamedTuple):
    """Vertices next to each other with one stencil: start (n,) int64, the first slot; length (n,) int64; stencil (n,) int64, row of the coefficients."""

    start: np.ndarray
    length: np.ndarray
    stencil: np.ndarray


@sweep
def stencil_forces(field, runs, offset, coefficient, spare, force):
    """Store f_a = sum_k sum_b C_kab u_b(slot + offset_k) of all vertices of the runs.

    field, force (dim, n_slots); offset (3^dim,) int64; coefficient (n_stencils, 3^dim, dim, dim), N/m; spare (dim, 8): room. Slots beyond both ends of a run
    by up to
    the largest offset and 8 exist and hold finite numbers.
    """
    for r in range(len(runs.start)):
        first, last = runs.start[r], runs.start[r] + runs.length[r]
        i = first
        while i + LANES <= last:
            if len(field) == 2:
                _plane(field, i, offset, coefficient, runs.stencil[r], force, force.shape[1], i)
            else:
                _space(field, i, offset, coefficient, runs.stencil[r], force, force.shape[1], i)
            i += LANES
        if i < last:
            if len(field) == 2:
                _plane(field, i, offset, coefficient, runs.stencil[r], spare, LANES, 0)
            else:
                _space(field, i, offset, coefficient, runs.stencil[r], spare, LANES, 0)
            for a in range(len(field)):
                for lane in range(last - i):
                    force[a, i + lane] = spare[a, lane]


@sweep
def _plane(field, i, offset, coefficient, row, out, pitch, place):
    """Store the forces on eight vertices of the plane at out[place], out[pitch + place]."""
    n, count = field.shape[1], len(offset)
    xx, xy, yx, yy = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    c = row * count * 4
    for k in range(count):
        j = i + at(offset, k)
        ux, uy = load8(field, j), load8(field, n + j)
        xx, xy = fma(splat(at(coefficient, c)), ux, xx), fma(splat(at(coefficient, c + 1)), uy, xy)
        yx, yy = fma(splat(at(coefficient, c + 2)), ux, yx), fma(splat(at(coefficient, c + 3)), uy, yy)
        c += 4
    store8(out, place, xx + xy)
    store8(out, pitch + place, yx + yy)


@sweep
def _space(field, i, offset, coefficient, row, out, pitch, place):
    """Store the forces on eight vertices in space at out[place], out[pitch + place], out[2 pitch + place]."""
    n, count = field.shape[1], len(offset)
    xx, xy, xz, yx, yy, yz = splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    zx, zy, zz = splat(0.0), splat(0.0), splat(0.0)
    c = row * count * 9
    for k in range(count):
        j = i + at(offset, k)
        ux, uy, uz = load8(field, j), load8(field, n + j), load8(field, 2 * n + j)
        xx, xy, xz = fma(splat(at(coefficient, c)), ux, xx), fma(splat(at(coefficient, c + 1)), uy, xy), fma(splat(at(coefficient, c + 2)), uz, xz)
        yx, yy, yz = fma(splat(at(coefficient, c + 3)), ux, yx), fma(splat(at(coefficient, c + 4)), uy, yy), fma(splat(at(coefficient, c + 5)), uz, yz)
        zx, zy, zz = fma(splat(at(coefficient, c + 6)), ux, zx), fma(splat(at(coefficient, c + 7)), uy, zy), fma(splat(at(coefficient, c + 8)), uz, zz)
        c += 9
    store8(out, place, xx + xy + xz)
    store8(out, pitch + place, yx + yy + yz)
    store8(out, 2 * pitch + place, zx + zy + zz)
