"""What a sweep over local particles goes through: rows of eight, those whose forces are blended, and the collar that moves as it is told."""
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.simd import LANES

WHOLE, MIXED, MOVING = 1, 2, 4
"""Marks of a row of eight: a particle with a force that counts, one whose blended force is not all its own, one that moves by itself."""


@dataclass
class Blended:
    """The particles, eight to a row, whose force is not all theirs: on the ramp, or within a bond of it. Lane l of row t stands at 8 t + l.

    rows (n,) int32, first slots. cell (8 n,) int32, local cell of each lane, -1 where this rank owns no particle; number (8 n,), of the particle in its cell;
    table (ratio^dim, 8), the cell's functions by that number, and zeros; alpha (8 n,); inside (8 n,) bool, in an enriched cell; density (8 n,), kg/m^3;
    impulse, moment (n, dim, 8): tau sum_j w_j F^alpha(U_j), N s/m^3, and tau^2 sum_j (k - j) w_j F^alpha(U_j), N s^2/m^3, w_j = 1/2 at both ends,
    else 1; before, velocity_before (n, dim, 8): u and v at the start of the step; seen (n,) bool, rows with a bond that broke, or was found strained, since
    they were last looked at.
    """

    rows: np.ndarray
    table: np.ndarray
    dim: int

    def __post_init__(self):
        n = LANES * len(self.rows)
        self.cell, self.number, self.alpha = np.empty(n, np.int32), np.empty(n, np.uint16), np.empty(n)
        self.inside, self.density, self.seen = np.empty(n, bool), np.empty(n), np.zeros(len(self.rows), bool)
        shape = len(self.rows), self.dim, LANES
        self.impulse, self.moment, self.before, self.velocity_before = (np.empty(shape) for _ in range(4))

    @property
    def lanes(self):
        """(cell, number, alpha, inside, density)."""
        return self.cell, self.number, self.alpha, self.inside, self.density

    @cached_property
    def shape(self):
        """(8 n, corners), values of the functions of each lane's cell."""
        return self.table[self.number, :4]


@dataclass
class Collar:
    """Particles that move as the global solution says: u + t v + t^2/2 a, with a extrapolated to the middle of the step. (n, dim) each."""

    slots: np.ndarray
    cell: np.ndarray
    number: np.ndarray
    dim: int
    displacement: np.ndarray = field(init=False)
    velocity: np.ndarray = field(init=False)
    acceleration: np.ndarray = field(init=False)

    def __post_init__(self):
        self.displacement, self.velocity, self.acceleration = (np.zeros((len(self.slots), self.dim)) for _ in range(3))


@kernel
def set_alpha(slots, cell, number, cells, shape, weight, alpha):
    """alpha[slots] = sum_a N_a weight at the corners of particles' cells; 0 or 1 where it is within round-off of these."""
    for n in range(len(slots)):
        corner, total = cells[cell[n]], 0.0
        for a in range(len(corner)):
            total += shape[number[n], a] * weight[corner[a]]
        if abs(total - 1.0) < 1e-9:
            total = 1.0
        alpha[slots[n]] = total if abs(total) > 1e-12 else 0.0


@kernel
def take_lanes(rows, status, cell, number, alpha, inside, block, density, lane_cell, lane_number, lane_alpha, lane_inside, lane_density):
    """Store in the arrays of Blended what fields by slot say of its lanes; cell holds a cell's number plus one. Status 0: not this rank's particle, or far."""
    for t in range(len(rows)):
        for lane in range(LANES):
            n, i = LANES * t + lane, rows[t] + lane
            mine = status[i] > 0
            lane_cell[n] = cell[i] - 1 if mine else -1
            lane_number[n], lane_alpha[n] = number[i], alpha[i]
            lane_inside[n] = mine and inside[i]
            lane_density[n] = density[block[i]] if mine else 0.0


@kernel
def mark_rows(slots, status, inverse_density, marks):
    """Set marks (n_slots / 8,) of the rows that hold `slots` (n,) from the status of their eight particles.

    status (n_slots,) : 0 no alpha around, 1 some, 2 all 1 (blend.find_blended). inverse_density (n_slots,) : above 0 where a particle moves; what acts on the others
    is not to be had from their motion.
    """
    for n in range(len(slots)):
        row = slots[n] // LANES
        if n > 0 and row == slots[n - 1] // LANES:
            continue
        mark = 0
        for i in range(LANES * row, min(LANES * row + LANES, len(status))):
            if status[i] > 0:
                mark |= WHOLE
            if status[i] == 1 or (status[i] == 2 and inverse_density[i] == 0.0):
                mark |= MIXED
            if inverse_density[i] > 0.0:
                mark |= MOVING
        marks[row] = mark


def rows_with(marks, wanted, unwanted):
    """Return (n,) int32, the first slots of rows that have the mark `wanted` and not `unwanted`, ascending. Local."""
    return (np.flatnonzero((marks & wanted > 0) & (marks & unwanted == 0)) * LANES).astype(np.int32)
