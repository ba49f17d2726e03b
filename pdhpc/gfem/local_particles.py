"""The local particles: the part of a lattice that lies in enriched cells, with a collar of prescribed particles around it, run for k sub-steps.

Lists of what is swept change only when patches are added; a step touches nothing beyond them. Arrays by slot are made as zeros and cost memory only where particles
ever were active: 8 (alpha) + 8 (inverse density) + 4 (cell) + 2 (number in the cell) + 2 bytes a slot beside those of the Subdomain.
"""
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from pdhpc.gfem import lanes
from pdhpc.gfem.loads import LoadOnLanes, sub_step_sums
from pdhpc.gfem.points import interpolate
from pdhpc.kernels import blend, sweeps
from pdhpc.kernels.lattice import mark_kinds
from pdhpc.kernels.simd import LANES


@dataclass
class Blended:
    """The particles, eight to a row, whose force is not all theirs: on the ramp, or within a bond of it. Lane l of row t stands at 8 t + l.

    rows (n,) int32, first slots. cell (8 n,) int32, local cell of each lane, -1 where this rank owns no particle; shape (8 n, corners), values of its functions;
    alpha (8 n,); inside (8 n,) bool, in an enriched cell; density (8 n,), kg/m^3; impulse, moment (n, dim, 8): tau sum_j w_j F^alpha(U_j), N s/m^3, and tau^2 sum_j (k - j) w_j F^alpha(U_j);
    before, velocity_before (n, dim, 8): u and v at the start of the step.
    """

    rows: np.ndarray
    cell: np.ndarray
    shape: np.ndarray
    alpha: np.ndarray
    inside: np.ndarray
    density: np.ndarray
    dim: int
    impulse: np.ndarray = field(init=False)
    moment: np.ndarray = field(init=False)
    before: np.ndarray = field(init=False)
    velocity_before: np.ndarray = field(init=False)

    def __post_init__(self):
        shape = len(self.rows), self.dim, LANES
        self.impulse, self.moment, self.before, self.velocity_before = (np.zeros(shape) for _ in range(4))


@dataclass
class Collar:
    """Particles that move as the global solution says: u + t v + t^2/2 a, with a extrapolated to the middle of the step. (n, dim) each."""

    slots: np.ndarray
    cell: np.ndarray
    shape: np.ndarray
    dim: int
    displacement: np.ndarray = field(init=False)
    velocity: np.ndarray = field(init=False)
    acceleration: np.ndarray = field(init=False)

    def __post_init__(self):
        self.displacement, self.velocity, self.acceleration = (np.zeros((len(self.slots), self.dim)) for _ in range(3))


class LocalParticles:
    """Particles of the enriched cells of one rank.

    Attributes
    ----------
    subdomain, law, lattice : Subdomain of the whole body, its law, and the CellLattice. density (n_block,). alpha (n_slots,). inside (n_slots,) bool.
    points : Points of the enriched owned cells. rows : int32, rows swept with whole forces. blended : Blended. collar : Collar.
    broken, bond_evaluations : directed bonds of this rank so far. seconds : {"force", "exchange", "wait", "integrate"}.
    """

    def __init__(self, lattice, subdomain, law, exchange, may_not_fail, loads):
        """exchange : GhostExchange of the Subdomain. may_not_fail (256,) uint8: the block of the same material whose bonds never break. loads : [ParticleLoad]."""
        self.lattice, self.subdomain, self.law, self._exchange, self._may_not_fail, self.loads = lattice, subdomain, law, exchange, may_not_fail, loads
        particles = subdomain.particles
        n_slots = len(particles.position)
        self.density, self._block = law.density, particles.block.copy()
        self.alpha, self._inverse_density = np.zeros(n_slots), np.zeros(n_slots)
        self.inside, self._cell, self._number = np.zeros(n_slots, bool), np.zeros(n_slots, np.int32), np.zeros(n_slots, np.uint16)
        self.enriched = np.zeros(len(lattice.mesh.cells), bool)
        self._positions, self.acting, self.load_work = None, [], 0.0
        self.broken, self.bond_evaluations, self.particle_steps = 0, 0, 0
        self.seconds = dict.fromkeys(("force", "exchange", "wait", "integrate"), 0.0)
        particles.block[:] = may_not_fail[particles.block]
        self._third, self.volume = particles.third, float(particles.volume[0]) if n_slots else 0.0

    def follow(self, patches, weight, displacement, velocity):
        """Take in the particles of newly enriched cells, with the state the mesh has there, and find what is swept. Local.

        weight : (n_vertices,), alpha is its interpolation. displacement, velocity : (n_vertices, dim), fresh ghosts included.
        """
        mesh, particles, lattice = self.lattice.mesh, self.subdomain.particles, self.lattice
        self._take_in(np.flatnonzero(patches.enriched & ~self.enriched), displacement, velocity)
        self.enriched = patches.enriched.copy()
        ramped = (weight[mesh.cells] > 0.0).any(axis=1)
        self._set_alpha(np.flatnonzero(ramped), weight)
        near = patches.around(ramped | patches.enriched)
        self.points = lattice.points_of(np.flatnonzero(patches.enriched[: mesh.n_owned_cells]), self.density)
        outer = np.flatnonzero(near & ~patches.enriched)
        slots, cells, numbers = self.slots_of(outer)
        ghost = cells >= mesh.n_owned_cells
        owned = np.concatenate([self.points.slots, slots[~ghost]])
        status = np.zeros(len(owned), np.int8)
        blend.find_blended(self.subdomain.bonds.arrays, particles.block, owned, self.alpha, status)
        self._cell[slots], self._number[slots] = cells + 1, numbers
        prescribed = ghost.copy()
        prescribed[~ghost] = status[len(self.points.slots) :] > 0
        self.collar = Collar(slots[prescribed], cells[prescribed], lattice.shape[numbers[prescribed]], mesh.dim)
        self._choose_rows(owned, status)
        self._positions = self._exchange.restricted(self.inside).bind(particles.position)
        self.load_work = self.external_work().sum()
        self.acting = [load.within(self.inside) for load in self.loads]
        self.acting_on_lanes = [LoadOnLanes(load, self.blended) for load in self.acting]

    def _take_in(self, cells, displacement, velocity):
        """Give the particles of new cells the nodal fields, and let them move and fail."""
        mesh, particles = self.lattice.mesh, self.subdomain.particles
        slots, cell, number = self.slots_of(cells)
        self.inside[slots] = True
        particles.block[slots] = self._block[slots]
        self._cell[slots], self._number[slots] = cell + 1, number
        owned = cell < mesh.n_owned_cells
        for target, source in ((particles.position, displacement), (particles.velocity, velocity)):
            mine = slots[owned] if target is particles.velocity else slots
            values = np.empty((len(mine), mesh.dim))
            chosen = owned if target is particles.velocity else slice(None)
            interpolate(mesh.cells, cell[chosen], self.lattice.shape[number[chosen]], source, values)
            target[mine] = values
        self._inverse_density[slots[owned]] = 1.0 / self.density[particles.block[slots[owned]]]

    def slots_of(self, cells):
        """Return (slots, cells, numbers in them) of the particles of local cells that this rank holds, (n,) each."""
        slots = self.lattice.slots_of(np.asarray(cells, np.int32))
        there = slots >= 0
        cell = np.repeat(np.asarray(cells, np.int32), there.sum(axis=1))
        return slots[there], cell, np.broadcast_to(np.arange(slots.shape[1], dtype=np.int32), slots.shape)[there]

    def _set_alpha(self, cells, weight):
        """Interpolate alpha in cells where it is above 0; values within round-off of 0 and 1 become these."""
        mesh = self.lattice.mesh
        values = weight[mesh.cells[cells]] @ self.lattice.shape.T
        values[np.abs(values - 1.0) < 1e-9] = 1.0
        values[np.abs(values) < 1e-12] = 0.0
        slots = self.lattice.slots_of(np.asarray(cells, np.int32))
        there = slots >= 0
        self.alpha[slots[there]] = values[there]

    def _choose_rows(self, owned, status):
        """Find the rows of eight with a particle that moves or whose blended force counts, and those of them where the two differ."""
        arrays, mesh = self.subdomain.bonds.arrays, self.lattice.mesh
        swept = np.unique(owned[(status > 0) | self.inside[owned]] // LANES)
        mixed = np.unique(owned[status == 1] // LANES)
        self.rows = (np.setdiff1d(swept, mixed, assume_unique=True) * LANES).astype(np.int32)
        self.moving = (np.unique(self.points.slots // LANES) * LANES).astype(np.int32)
        mark_kinds(arrays.offset, self._block, (swept * LANES).astype(np.int32), arrays.kind)  # a collar has the moduli of its material
        lane = (mixed[:, None] * LANES + np.arange(LANES)).ravel()
        mine = np.zeros(len(self.alpha), bool)
        mine[owned] = True
        cell = np.where(mine[lane], self._cell[lane] - 1, -1).astype(np.int32)
        shape = self.lattice.shape[self._number[lane]]
        density = self.density[np.where(cell < 0, 0, self._block[lane])]
        self.blended = Blended((mixed * LANES).astype(np.int32), cell, shape, self.alpha[lane], self.inside[lane] & mine[lane], density, mesh.dim)

    def outside(self, cells):
        """Return (n, ratio^dim), 1 - alpha at the particles of owned cells (n,), 0 where there is none. Local."""
        slots = self.lattice.slots_of(np.asarray(cells, np.int32))
        return np.where(slots >= 0, 1.0 - self.alpha[slots], 0.0)

    def original_block(self, slots):
        """Return the blocks of particles as the scene has them, whether or not they may fail at present. Local."""
        return self._block[slots]

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per sub-step."""
        return self._positions.bytes_sent if self._positions is not None else 0

    def hold_collar(self, displacement, velocity, acceleration):
        """Take from nodal fields (n_vertices, dim), ghosts fresh, how the collar moves in the step to come. Local."""
        collar, cells = self.collar, self.lattice.mesh.cells
        for nodal, held in ((displacement, collar.displacement), (velocity, collar.velocity), (acceleration, collar.acceleration)):
            interpolate(cells, collar.cell, collar.shape, nodal, held)

    def run(self, k, tau, start):
        """Do k sub-steps of tau, s, from time `start` of velocity Verlet; blended impulses are summed on the way. Collective over neighbours.

        u and v of the particles, positions of ghosts included, are those of the global solution at the start. They are the local run's at the end.
        """
        blended, particles = self.blended, self.subdomain.particles
        self.tau, self.start = tau, start
        lanes.remember(blended.rows, particles.position, particles.velocity, blended.before, blended.velocity_before)
        blended.impulse[:] = 0.0
        blended.moment[:] = 0.0
        self._place_collar(0.0)
        self._forces(0.5 * tau, 0.5 * k * tau**2, start)
        for j in range(1, k + 1):
            self._drift(0.5 * tau if j == 1 else tau, tau)
            for load in self.acting:
                load.do_work(particles.velocity, start + j * tau, tau)
            self._place_collar(j * tau)
            self.refresh()
            self._forces(0.5 * tau if j == k else tau, (k - j) * tau**2, start + j * tau)
        self._kick(0.5 * tau)
        self.particle_steps += k * len(self.points.slots)

    def add_loads_to_sums(self, k):
        """Add what loads on blended particles did in the k sub-steps of the last run to their impulses and moments. Local."""
        for load in self.acting_on_lanes:
            load.add_to(self.blended, *sub_step_sums(load.time_function, self.start, self.tau, k))

    def refresh(self):
        """Bring the positions of moving ghosts up to date. Collective over neighbours."""
        started = perf_counter()
        self._positions.refresh()
        self.seconds["wait"] += perf_counter() - started

    def _forces(self, weight, moment_weight, time):
        """Evaluate forces, breaking bonds, and add their blended part, times these weights, to the impulses."""
        started = perf_counter()
        particles = self.subdomain.particles
        self.broken += self._sweep(self.subdomain.bonds.arrays, self.law, np.array([weight, moment_weight]))
        for load in self.acting:
            load.add_to(particles.force_density, time)
        self.seconds["force"] += perf_counter() - started

    def _sweep(self, bonds, law, weights):
        """Evaluate forces and add their blended part, times the two weights, to the impulses and moments; return the directed bonds that broke. Local."""
        domain, particles, blended = self.subdomain, self.subdomain.particles, self.blended
        broken = sweeps.bond_forces(bonds, domain.points, law, None, True, self._third, self.rows, particles.force_density, particles.dissipated)
        broken += blend.blended_forces(bonds, domain.points, law, self._third, blended.rows, self.alpha, particles.force_density, particles.dissipated, weights,
                                       blended.impulse, blended.moment)
        self.bond_evaluations += LANES * (len(self.rows) + len(blended.rows)) * len(bonds.offset)
        return broken

    def evaluate(self, time=None):
        """Store the present blended forces F^alpha in the impulses, N/m^3, whole ones in force_density, loads at `time`, s, included. Collective over neighbours.

        The collar stands where hold_collar has put it. Without a time there are no loads, and no bond breaks: linear in the displacements.
        """
        particles, blended, bonds, law = self.subdomain.particles, self.blended, self.subdomain.bonds.arrays, self.law
        blended.impulse[:] = 0.0
        blended.moment[:] = 0.0
        self._place_collar(0.0)
        self.refresh()
        if time is None:
            bonds, law = bonds._replace(trigger=np.full_like(bonds.trigger, np.inf)), law._replace(break_at=np.full_like(law.break_at, np.inf))
        self.broken += self._sweep(bonds, law, np.array([1.0, 0.0]))
        if time is not None:
            for load in self.acting:
                load.add_to(particles.force_density, time)
            for load in self.acting_on_lanes:
                load.add_to(blended, load.time_function.value(time), 0.0)

    def _drift(self, kick, tau):
        started = perf_counter()
        particles = self.subdomain.particles
        lanes.kick_drift(self.moving, particles.velocity, particles.force_density, self._inverse_density, particles.position, kick, tau)
        self.seconds["integrate"] += perf_counter() - started

    def _kick(self, tau):
        started = perf_counter()
        particles = self.subdomain.particles
        lanes.kick(self.moving, particles.velocity, particles.force_density, self._inverse_density, tau)
        self.seconds["integrate"] += perf_counter() - started

    def _place_collar(self, t):
        """Put the collar where it is at the time t after the start of the step."""
        started = perf_counter()
        collar = self.collar
        lanes.place(collar.slots, collar.displacement, collar.velocity, collar.acceleration, t, self.subdomain.particles.position)
        self.seconds["integrate"] += perf_counter() - started

    def external_work(self):
        """Return (n,) J, contributions to the work of loads on the particles of enriched cells. Local."""
        return np.concatenate([np.array([self.load_work]), *(load.work * self.volume for load in self.acting)])

    def wanting(self, cells, share):
        """Return (n,) bool: owned cells (n,) with a particle that is stretched beyond `share` of its limit, or has a broken bond. Local."""
        slots = self.lattice.slots_of(np.asarray(cells, np.int32))
        there = slots >= 0
        flags = np.zeros(int(there.sum()), bool)
        blend.strained_or_broken(self.subdomain.bonds.arrays, self.subdomain.points, self.law, self._third, slots[there], share, flags)
        found = np.zeros(slots.shape, bool)
        found[there] = flags
        return found.any(axis=1)
