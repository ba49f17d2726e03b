"""One rank's share of the body: made in place from the bodies, without messages and without anything global."""
import numpy as np

from pdhpc.geometry.lattice import points_of_bodies
from pdhpc.jit import kernel
from pdhpc.kernels import sweeps
from pdhpc.kernels.family import MIXED, VARIED, PointArrays
from pdhpc.kernels.neighbours import CorrectedArrays, count_neighbours
from pdhpc.kernels.shared import row_width_of, share_bonds
from pdhpc.kernels.strength import scatter_strengths
from pdhpc.peridynamics.bonds import find_families
from pdhpc.peridynamics.particles import Particles

SAMPLE = 60_000
"""Particles per rank that the partition is computed from: its imbalance is then about half a percent."""
_PIECE = 1 << 18  # particles whose places are looked up at once: bounds the temporary memory
_MARGIN = 1e-6  # relative to the family radius: points this far outside still count as candidates for ghosts


class Subdomain:
    """Particles, bonds and the owners of the ghosts of one rank.

    Memory per particle at 122 neighbours in 3D: of a cloud 12 bytes a bond slot (1536), bond states 16, particle arrays 180, so 1.7 kB; ghosts hold the
    constants and positions only (81 bytes). Of a lattice 16 bytes of bond states, 105 for the fields of each cell, padding included, and 16 a particle.

    Attributes
    ----------
    particles : Particles or LatticeParticles. bonds : Bonds. points : PointArrays. ghost_owner : (n_ghost,) ranks.
    rows : (interior, border), int32: what a sweep goes through; only the border touches ghosts.
    shared, shared_rows : None and two empty lists, or the shares of marked particles (kernels/shared.py) and their rows, taken out of `rows`.
    state : None, or (n_slots, 2), see `make_state`.
    """

    def __init__(self, particles, bonds, ghost_owner, points, rows):
        self.particles, self.bonds, self.ghost_owner, self.points, self.rows = particles, bonds, ghost_owner, points, rows
        self.state = self.shared = None
        self.shared_rows = (np.empty(0, np.int32), np.empty(0, np.int32))

    def groups(self, part):
        """Return [(bonds, rows)] that a sweep over the interior (part 0) or the border (1) goes through. Local."""
        plain = [(self.bonds.arrays, self.rows[part])]
        return plain if self.shared is None else plain + [(self.shared, self.shared_rows[part])]

    def share_rows(self, marked):
        """Give the bonds of the particles in the slots `marked` (n,) weights of their own, all 1, and sweep them apart from the others. Local."""
        width = row_width_of(self.bonds.arrays)
        chosen = np.unique(np.asarray(marked) // width) * width
        both = [np.isin(rows, chosen, assume_unique=True) for rows in self.rows]
        self.shared_rows = tuple(rows[inside] for rows, inside in zip(self.rows, both))
        self.rows = tuple(rows[~inside] for rows, inside in zip(self.rows, both))
        self.shared = share_bonds(self.bonds.arrays, len(self.points.position), np.concatenate(self.shared_rows))

    def keep_rows(self, chosen):
        """Sweep only rows with a particle that `chosen` (function points -> bool) takes; the others neither feel forces nor count. Local."""
        particles, width = self.particles, row_width_of(self.bonds.arrays)
        mine = chosen(self.places()) if particles.n_owned else np.zeros(0, bool)
        kept = np.unique(particles.slots[mine] // width) * width
        self.rows = tuple(rows[np.isin(rows, kept)] for rows in self.rows)
        self.bonds.family_size = np.where(mine, self.bonds.family_size, 0)
        self.bonds.initial_size = self.bonds.family_size

    def marked(self):
        """Return (n_owned,) bool: which owned particles lie in shared rows. Local."""
        if self.shared is None:
            return np.zeros(self.particles.n_owned, bool)
        return self.shared.row[self.particles.slots // row_width_of(self.bonds.arrays)] >= 0

    def make_state(self, law):
        """Make the state of a state-based law: a_i of the owned particles from their intact bonds, and p_i; nothing for other laws. Local.

        The ghosts' a_i must be refreshed once. Particles of materials that soften get their `raised` (kernels/failure.py), of those that scatter their `strength`.
        """
        if hasattr(law.failure, "modulus"):
            self._scatter(law)
        if hasattr(law.failure, "softening"):
            self.points = self.points._replace(raised=np.zeros(len(self.points.position)))
        if not hasattr(law, "volumetric"):
            return
        n_slots = len(self.points.position)
        lattice = not self.particles.contiguous
        self.state = np.zeros((2, n_slots)).T if lattice else np.zeros((n_slots, 2))
        sweeps.weighted_volumes(self.bonds.arrays, self.points, law, self.particles.slots, self.state)

    def _scatter(self, law):
        """Draw the strengths of owned particles and of ghosts. Local."""
        particles, strength = self.particles, np.ones(len(self.points.position))
        slots = np.concatenate([particles.slots, particles.ghost_slots])
        for first in range(0, len(slots), _PIECE):
            piece = slice(first, first + _PIECE)
            scatter_strengths(particles.id[piece], self.places_at(slots[piece]), slots[piece], particles.block, law.failure, strength)
        self.points = self.points._replace(strength=strength)

    def correct_surfaces(self, factor):
        """Multiply the micromodulus of each bond of a cloud, by slot, by factor (n_bond_slots,). Local."""
        self.bonds.arrays = CorrectedArrays(*self.bonds.arrays, factor)

    def places(self, members=slice(None)):
        """Return (n, dim) reference positions, m, of owned particles, all or those that `members` names. Local."""
        return self.places_at(self.particles.slots[members])

    def places_at(self, slots):
        """Return (n, dim) reference positions, m, of the particles in `slots` (n,). Local."""
        slots = np.atleast_1d(slots)
        result = np.empty((len(slots), self.particles.dim))
        sweeps.places(self.bonds.arrays, self.points, slots, result)
        return result


def sample_with_weights(bodies, bounds, rank, size, radius):
    """Return (points, weights) of the rank-th of `size` equal slabs of the bodies: what the partition is computed from. Local.

    The slabs cut the longest side of `bounds` (lower, upper), m; weights (n,) int64 are numbers of neighbours, at least 1, times the particles that each of
    the points stands for.
    """
    return sample_in(bodies, *slab_of(bounds, rank, size), radius)


def slab_of(bounds, rank, size):
    """Return (lower, upper), m, of the rank-th of `size` equal slabs of space, which cut the longest side of `bounds` (lower, upper), m. Local."""
    lower, upper = bounds
    axis = int(np.argmax(upper - lower))
    edges = np.linspace(lower[axis], upper[axis], size + 1)
    edges[0], edges[-1] = -np.inf, np.inf
    low, high = np.full(len(lower), -np.inf), np.full(len(lower), np.inf)
    low[axis], high[axis] = edges[rank], edges[rank + 1]
    return low, high


def sample_in(bodies, lower, upper, radius):
    """Return (points, weights) as sample_with_weights of the half-open box lower <= x < upper, m. Local."""
    reach = reach_of(radius)
    ids, points, body = points_of_bodies(bodies, lower - reach, upper + reach)
    inside = np.all((points >= lower) & (points < upper), axis=1)
    share = max(1, int(inside.sum()) // SAMPLE)
    chosen = inside & ((ids * 2654435761 >> 12) % share == 0)  # all particles of a small body, a scattered share of a large one
    points, body = (np.concatenate([values[chosen], values[~chosen]]) for values in (points, body))
    n = int(chosen.sum())
    return points[:n], np.maximum(1, count_neighbours(points, n, radius, body)).astype(np.int64) * share


def reach_of(radius):
    """Return how far from a box, m, ghosts of its particles are looked for: the family radius, the largest of a table, and a little more."""
    return np.max(radius) * (1 + _MARGIN)


def make_subdomain(bodies, partition, rank, radius, describe, linear):
    """Return the Subdomain that `rank` owns. Local.

    Parameters
    ----------
    bodies : list of LatticeBody and of PointBody with the points in reach. partition : Partition.
    radius : m, of the families, or a table (n_body, n_body) by the bodies of both ends, 0 for no bonds.
    describe : function (points, body index, ids) -> (volume, block) of particles, m^3 and uint8. linear : bool, kinematics.
    """
    dim = len(bodies[0].bounds()[0])
    lower, upper = partition.box(rank, dim)
    ids, points, body = points_of_bodies(bodies, lower, upper)
    ghost_ids, ghost_points, ghost_body, ghost_owner = _ghost_candidates(bodies, partition, rank, np.max(radius), points)
    n_owned = len(ids)
    ids, points, body = np.concatenate([ids, ghost_ids]), np.concatenate([points, ghost_points]), np.concatenate([body, ghost_body])
    del ghost_points, ghost_ids
    bonds, keep = find_families(points, ids, n_owned, radius, body)
    ids, points, body, ghost_owner = ids[keep], points[keep], body[keep], ghost_owner[keep[n_owned:]]
    volume, block = describe(points, body, ids)
    particles = Particles(ids, points, volume, block, n_owned, linear)
    border = _touch_ghosts(bonds.arrays.row_start, bonds.arrays.neighbour, n_owned)
    arrays = PointArrays(particles.padded_reference, particles.position, particles.volume, particles.block, _row_blocks(particles, bonds))
    return Subdomain(particles, bonds, ghost_owner, arrays, (particles.slots[~border], particles.slots[border]))


def _ghost_candidates(bodies, partition, rank, radius, owned):
    """Return (ids, points, bodies, owners) of the particles of other ranks in the box of the owned ones grown by the family radius, by (owner, id)."""
    dim = owned.shape[1]
    if len(owned) == 0 or partition.size == 1:
        return np.empty(0, np.int64), np.empty((0, dim)), np.empty(0, np.int32), np.empty(0, np.int64)
    reach = reach_of(radius)
    inner_lower, inner_upper = partition.box(rank, dim)
    lower = np.where(np.isfinite(inner_lower), owned.min(axis=0) - reach, -np.inf)
    upper = np.where(np.isfinite(inner_upper), owned.max(axis=0) + reach, np.inf)
    pieces = [points_of_bodies(bodies, low, high) for low, high in _shell(lower, upper, inner_lower, inner_upper)]
    pieces = pieces or [points_of_bodies([], lower, upper)]  # a rank's bodies may end far from its borders
    ids, points, body = (np.concatenate([piece[part] for piece in pieces]) for part in range(3))
    owner = partition.owner(points)
    order = np.lexsort((ids, owner))
    return ids[order], points[order], body[order], owner[order]


def _shell(lower, upper, inner_lower, inner_upper):
    """Return disjoint half-open boxes that make up the outer box without the inner one."""
    boxes = []
    low, high = lower.copy(), upper.copy()
    for axis in range(len(lower)):
        for side_low, side_high in ((low[axis], inner_lower[axis]), (inner_upper[axis], high[axis])):
            if side_low < side_high:
                box_low, box_high = low.copy(), high.copy()
                box_low[axis], box_high[axis] = side_low, side_high
                boxes.append((box_low, box_high))
        low[axis], high[axis] = max(low[axis], inner_lower[axis]), min(high[axis], inner_upper[axis])
    return boxes


def _row_blocks(particles, bonds):
    """Return (n_owned,) uint8: the block of a row whose particle and neighbours agree in block and volume, else VARIED or MIXED."""
    row_block = particles.owned(particles.block).copy()
    volume, block = particles.volume, particles.block
    if np.ptp(volume) > 0 or np.ptp(block) > 0 if len(volume) else False:
        mark_mixed(bonds.arrays.row_start, bonds.arrays.neighbour, volume, block, row_block)
    return row_block


@kernel
def mark_mixed(row_start, neighbour, volume, block, row_block):
    """Store in row_block (n_owned,) MIXED of the rows with a neighbour of another block, VARIED of those with one of another volume only."""
    for i in range(len(row_block)):
        for k in range(row_start[i], row_start[i + 1]):
            j = neighbour[k]
            if block[j] != block[i]:
                row_block[i] = MIXED
                break
            if volume[j] != volume[i]:
                row_block[i] = VARIED


@kernel
def _touch_ghosts(row_start, neighbour, n_owned):
    """Return (n_owned,) bool: which rows have a ghost among their neighbours."""
    touches = np.zeros(n_owned, np.bool_)
    for i in range(n_owned):
        for k in range(row_start[i], row_start[i + 1]):
            if neighbour[k] >= n_owned:
                touches[i] = True
                break
    return touches
