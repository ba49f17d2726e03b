"""One rank's share of bodies on a common lattice: made in place from the bodies, without messages and without anything global."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.family import MIXED, PointArrays
from pdhpc.kernels.lattice import WORD, LatticeArrays
from pdhpc.kernels.simd import LANES
from pdhpc.materials.law import bond_weight, modulus, moment_weight
from pdhpc.peridynamics.bonds import Bonds
from pdhpc.peridynamics.grid import Grid
from pdhpc.peridynamics.particles import LatticeParticles
from pdhpc.peridynamics.subdomain import SAMPLE, Subdomain

_SAMPLE = 20_000  # cells per rank that the partition of a large body is computed from
_EARLY = 1e-12  # relative: how much before its limit a bond is looked at closely
_PIECE = 1 << 18  # cells tested at once: bounds the temporary memory


def make_stencil(dim, ratio):
    """Return (n, dim) int64: cells within `ratio` spacings of one, itself left out, in the order of their ids."""
    reach = int(ratio)
    cells = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    square = (cells**2).sum(axis=1)
    return cells[(square > 0) & (square <= ratio**2)]


def sample_lattice(bodies, lattice, rank, size, radius):
    """Return (points, weights) as subdomain.sample_with_weights does, of bodies on a common lattice. Local.

    Small bodies are counted whole, at a byte for each cell of the rank-th slab; of large ones _SAMPLE cells are drawn and only these and their neighbours
    tested. Weights add up to about the number of directed bonds of all bodies.
    """
    ratio = radius / lattice.spacing
    cells = sum(_number_of_cells(body) for body in bodies)
    if cells > 4 * size * SAMPLE:
        return _draw(bodies, lattice, rank, size, make_stencil(len(lattice.origin), ratio))
    first, last = _cell_bounds(bodies, lattice, np.full(len(lattice.origin), -np.inf), np.full(len(lattice.origin), np.inf))
    axis = int(np.argmax(last - first))
    edges = first[axis] + (last[axis] - first[axis]) * np.arange(size + 1) // size
    first[axis], last[axis] = edges[rank], edges[rank + 1]
    grid = Grid(lattice, first, last, int(ratio))
    present = np.zeros(grid.n_slots, np.bool_)
    owned = [np.empty(0, np.int32)]
    for body, shift in zip(bodies, lattice.shifts):
        for slab in body.slabs_in(*grid.bounds()):
            slots = grid.slots(slab, shift)
            present[slots] = True
            owned.append(slots[grid.owns(slab, shift)])
    chosen = np.concatenate(owned)
    weights = np.empty(len(chosen), np.int64)
    _count_present(present, chosen, grid.offsets(make_stencil(len(first), ratio)), weights)
    points = np.stack([grid.coordinate[a, chosen // grid.step[a] % grid.cells[a]] for a in range(len(first))], axis=1)
    return points, weights


def _number_of_cells(body):
    """Return how many cells the box around the body's window holds."""
    first, last = body.window_cells()
    return int(np.prod(last - first, dtype=object))


def _draw(bodies, lattice, rank, size, stencil):
    """Return (points, weights) of cells drawn evenly and at random from the rank-th of `size` equal shares of every body's ids."""
    points, weights = [], []
    interval = max(1, sum(_number_of_cells(body) for body in bodies) // (size * _SAMPLE))
    for body, shift in zip(bodies, lattice.shifts):
        count, (first, last) = _number_of_cells(body), body.window_cells()
        edges = [count * number // size for number in (rank, rank + 1)]
        start = np.arange(edges[0], edges[1], interval)
        drawn = start + (start * 2654435761 >> 12) % interval
        cells = np.stack(np.unravel_index(drawn[drawn < edges[1]], tuple(last - first)), axis=1) + first + shift
        cells = cells[_holds_particle([body], [shift], lattice, cells)] if count else np.empty((0, len(first)), np.int64)
        for piece in np.array_split(cells, max(1, len(cells) * len(stencil) // _PIECE)):
            near = (piece[:, None, :] + stencil).reshape(-1, stencil.shape[1])
            weights.append(_holds_particle(bodies, lattice.shifts, lattice, near).reshape(len(piece), -1).sum(axis=1))
            points.append(lattice.origin + (piece + 0.5) * lattice.spacing)
    return np.concatenate(points), np.maximum(1, np.concatenate(weights)) * interval


def _holds_particle(bodies, shifts, lattice, cells):
    """Return (n,) bool, which cells (n, dim) of the lattice hold a particle."""
    held = np.zeros(len(cells), bool)
    for body, shift in zip(bodies, shifts):
        inside = ((cells >= shift) & (cells < shift + body.cells)).all(axis=1)
        inside[inside] = body.contains(lattice.origin + (cells[inside] + 0.5) * lattice.spacing)
        held |= inside
    return held


def make_lattice_subdomain(bodies, lattice, partition, rank, radius, describe, law, linear):
    """Return the Subdomain that `rank` owns of bodies on a common lattice. Local.

    Parameters
    ----------
    bodies : list of LatticeBody. lattice : CommonLattice. partition : Partition, cut between layers of cells. radius : m, of the families.
    describe : function (points, body index, ids) -> (volume, block). law : of materials/. linear : bool, kinematics.

    Raises
    ------
    ValueError: two particles at the same place.
    """
    dim = len(lattice.origin)
    first, last = _cell_bounds(bodies, lattice, *partition.box(rank, dim))
    grid = Grid(lattice, first, last, int(radius / lattice.spacing))
    block, cell_volume, owned, others = _fill(bodies, grid, describe)
    stencil = make_stencil(dim, radius / lattice.spacing)
    rows = grid.rows(len(law.density) == 1 or np.ptp(law.density) == 0)
    arrays = _make_bonds(grid, stencil, block, rows, law, cell_volume)
    blocks = _blocks_with_particles(block, rows.start, rows.width)
    foreign = np.zeros(grid.n_slots, np.uint8)
    foreign[others[1]] = 1
    border = np.zeros(len(blocks), np.bool_)
    if len(others[1]):
        near = _spread(grid, foreign)
        _find_border(arrays.offset, arrays.alive, blocks, near, foreign, border)
    _find_kinds(arrays.offset, block, blocks, arrays.kind)
    used = foreign[others[1]] == 2
    owner = partition.owner(others[2][used])
    order = np.lexsort((others[0][used], owner))
    ghost_ids, ghost_slots = others[0][used][order], others[1][used][order]
    block[others[1][~used]] = MIXED
    particles = LatticeParticles(np.concatenate([owned[0], ghost_ids]), owned[1], ghost_slots, block, cell_volume, rows, dim, linear)
    family_size = np.empty(len(owned[1]), np.int16 if len(stencil) < 2**15 else np.int32)
    bonds = Bonds(arrays, owned[1], family_size, family_size)
    bonds.count(family_size)
    points = PointArrays(np.empty((0, dim)), particles.position, particles.volume, block, np.empty(0, np.uint8))
    return Subdomain(particles, bonds, owner[order], points, (blocks[~border], blocks[border]))


def _cell_bounds(bodies, lattice, lower, upper):
    """Return (first, last), (dim,) int64: the range of cells of the lattice that hold the bodies' cells in a box."""
    firsts, lasts = [], []
    for body, shift in zip(bodies, lattice.shifts):
        ranges = np.array(body.cells_in(lower, upper), dtype=np.int64)
        if (ranges[:, 1] > ranges[:, 0]).all():
            firsts.append(ranges[:, 0] + shift)
            lasts.append(ranges[:, 1] + shift)
    if not firsts:
        return np.zeros(len(lower), np.int64), np.zeros(len(lower), np.int64)
    return np.min(firsts, axis=0), np.max(lasts, axis=0)


def _fill(bodies, grid, describe):
    """Return (block by slot, cell volume, (ids, slots) of owned particles, (ids, slots, points) of others in reach)."""
    block = np.full(grid.n_slots, MIXED, np.uint8)
    dim, cell_volume = len(grid.first), 0.0
    owned, others = [(np.empty(0, np.int64), np.empty(0, np.int32))], [(np.empty(0, np.int64), np.empty(0, np.int32), np.empty((0, dim)))]
    for number, body in enumerate(bodies if (grid.last > grid.first).all() else []):
        for slab in body.slabs_in(*grid.bounds()):
            if not len(slab.ids):
                continue
            slots, mine = grid.slots(slab, grid.lattice.shifts[number]), grid.owns(slab, grid.lattice.shifts[number])
            if number and (block[slots] != MIXED).any():
                raise ValueError("two particles lie at the same place: bodies overlap")
            volume, block[slots] = describe(slab.points, np.full(len(slots), number, np.int32), slab.ids)
            cell_volume = float(volume[0])
            owned.append((slab.ids[mine], slots[mine]))
            others.append((slab.ids[~mine], slots[~mine], slab.points[~mine]))
    return block, cell_volume, tuple(np.concatenate(part) for part in zip(*owned)), tuple(np.concatenate(part) for part in zip(*others))


def _make_bonds(grid, stencil, block, rows, law, cell_volume):
    """Return the LatticeArrays of the owned cells, every bond to a particle alive."""
    vector = stencil * grid.lattice.spacing
    length = np.sqrt((vector**2).sum(axis=1))
    weight, weight_length = (np.empty((len(law.density) + 1, len(stencil))) for _ in range(2))
    moments = np.empty(len(stencil))
    _weights(law, 1.0 / length, length, cell_volume, weight, weight_length, moments)
    limits = np.append(np.diag(law.break_at), law.break_at.min())
    trigger = limits[:, None] * length**2 * (1 - _EARLY)
    alive = np.zeros((-(-len(stencil) // WORD), grid.n_slots), np.uint64)
    offset = grid.offsets(stencil)
    near_edge = _spread(grid, (block == MIXED).view(np.uint8))
    _set_bits(offset, block, near_edge, rows.start, rows.width, alive)
    kind = np.full(grid.n_slots // LANES, MIXED, np.uint8)
    return LatticeArrays(offset, vector, length, 1.0 / length, weight, weight_length, moments, trigger, alive, kind, grid.step, grid.cells, grid.coordinate)


@kernel
def _count_present(present, slots, offset, counts):
    for n in range(len(slots)):
        total = 0
        for k in range(len(offset)):
            total += present[slots[n] + offset[k]]
        counts[n] = max(1, total)


@kernel
def _weights(law, inv_length, length, cell_volume, weight, weight_length, moments):
    """Store the tables `weight`, `weight_length` and `moment_weight` of LatticeArrays.

    The modulus comes in last, as it does where kernels look it up: a particle has the same bits whichever way, and blocks of eight differ between ranks.
    """
    last = len(weight) - 1
    for k in range(len(inv_length)):
        weight[last, k] = bond_weight(law, law.weighting, inv_length[k]) * cell_volume
        weight_length[last, k] = weight[last, k] * length[k]
        moments[k] = moment_weight(law, law.weighting, inv_length[k]) * cell_volume
        for block in range(last):
            weight[block, k] = weight[last, k] * modulus(law, block)
            weight_length[block, k] = weight_length[last, k] * modulus(law, block)


def _spread(grid, marked):
    """Return (n_slots,) uint8: 1 wherever a slot of the cube of 2 reach + 1 cells about a slot is marked (and here and there besides). Local."""
    for axis in range(len(grid.first)):
        marked = _spread_along(marked, int(grid.step[axis]), grid.reach)
    return marked


@kernel
def _spread_along(marked, step, reach):
    n, result = len(marked), marked.copy()
    margin = min(n, step * reach)
    for i in range(margin):
        result[i] = 1
        result[n - 1 - i] = 1
    for k in range(1, reach + 1):
        for i in range(margin, n - margin):
            result[i] |= marked[i - k * step] | marked[i + k * step]
    return result


@kernel
def _set_bits(offset, block, near_edge, row_start, width, alive):
    """Set the bit of every bond between an owned particle and a particle: all of them at once where no cell near is empty."""
    whole = np.zeros(len(alive), np.uint64)
    for k in range(len(offset)):
        whole[k >> 6] |= np.uint64(1) << np.uint64(k & 63)
    for row in range(len(row_start)):
        for i in range(row_start[row], row_start[row] + width):
            if near_edge[i] == 0:
                for w in range(len(alive)):
                    alive[w, i] = whole[w]
            elif block[i] != MIXED:
                for k in range(len(offset)):
                    alive[k >> 6, i] |= np.uint64(block[i + offset[k]] != MIXED) << np.uint64(k & 63)


@kernel
def _blocks_with_particles(block, row_start, width):
    """Return (n,) int32: first slots of the blocks of eight that hold an owned particle."""
    blocks = np.empty(len(row_start) * ((width + 7) // 8), np.int32)
    count = 0
    for row in range(len(row_start)):
        for first in range(row_start[row], row_start[row] + width, 8):
            for i in range(first, min(first + 8, row_start[row] + width)):
                if block[i] != MIXED:
                    blocks[count] = first
                    count += 1
                    break
    return blocks[:count].copy()


@kernel
def _find_border(offset, alive, blocks, near, foreign, border):
    """Mark blocks with a bond to a particle of another rank, and those particles by 2 in `foreign` (1: another rank's); near: where one may be in reach."""
    for t in range(len(blocks)):
        for i in range(blocks[t], blocks[t] + 8):
            if near[i] == 0:
                continue
            for k in range(len(offset)):
                if foreign[i + offset[k]] != 0 and (alive[k >> 6, i] >> np.uint64(k & 63)) & np.uint64(1) != 0:
                    foreign[i + offset[k]] = 2
                    border[t] = True


@kernel
def _find_kinds(offset, block, blocks, kind):
    """Store in kind the block number that all particles of a block of eight and all within reach of them have, where they agree."""
    only, agree = MIXED, True
    for i in range(len(block)):
        if block[i] != MIXED:
            agree = agree and (only == MIXED or block[i] == only)
            only = block[i]
    for t in range(len(blocks)):
        if agree:
            kind[blocks[t] >> 3] = only
            continue
        same, one = MIXED, True
        for i in range(blocks[t], blocks[t] + 8):
            if block[i] == MIXED:
                continue
            if same == MIXED:
                same = block[i]
            one = one and block[i] == same
            for k in range(len(offset)):
                j = block[i + offset[k]]
                one = one and (j == MIXED or j == same)
            if not one:
                break
        kind[blocks[t] >> 3] = same if one else MIXED
