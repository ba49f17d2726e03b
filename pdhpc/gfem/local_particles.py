"""The local particles: the part of a lattice that lies in enriched cells, with a collar of prescribed particles around it, run for k sub-steps.

Lists of what is swept change only when patches are added; a step touches nothing beyond them. Arrays by slot are made as zeros and cost memory only where
particles ever were active: 8 (alpha) + 8 (inverse density) + 4 (cell) + 2 (number in the cell) + 2 bytes a slot beside those of the Subdomain.
"""
from functools import cached_property
from time import perf_counter

import numpy as np

from pdhpc.gfem import lanes
from pdhpc.gfem.loads import LoadOnLanes, sub_step_sums
from pdhpc.gfem.swept import MIXED, MOVING, WHOLE, Blended, Collar, mark_rows, rows_with, set_alpha, take_lanes
from pdhpc.gfem.points import interpolate
from pdhpc.kernels import blend, sweeps
from pdhpc.kernels.simd import LANES


class LocalParticles:
    """Particles of the enriched cells of one rank.

    Attributes
    ----------
    subdomain, law, lattice : Subdomain of the whole body, its law, and the CellLattice. density (n_block,). alpha (n_slots,). inside (n_slots,) bool.
    cells (n,) int32, cell_slots (n, ratio^dim) int64 : the enriched owned cells, ascending whenever they came, and their particles: bodies hold whole cells.
    rows : int32, rows swept with whole forces; moving : rows with a particle that moves. blended : Blended, cells that are watched among them. collar : Collar.
    watched (n_owned_cells,) bool : enriched cells with vertices that may still join J.
    broken, bond_evaluations : directed bonds of this rank so far. seconds : {"force", "exchange", "wait", "integrate"}.
    """

    def __init__(self, lattice, subdomain, law, exchange, may_not_fail, loads):
        """exchange : GhostExchange of the Subdomain. may_not_fail (256,) uint8: the block of the same material that never breaks. loads : [ParticleLoad]."""
        self.lattice, self.subdomain, self.law, self._exchange, self.loads = lattice, subdomain, law, exchange, loads
        particles = subdomain.particles
        n_slots = len(particles.position)
        self.density, self._block = law.density, particles.block.copy()
        self.alpha, self._inverse_density = np.zeros(n_slots), np.zeros(n_slots)
        self.inside, self._cell, self._number = np.zeros(n_slots, bool), np.zeros(n_slots, np.int32), np.zeros(n_slots, np.uint16)
        self._status, self._swept = np.zeros(n_slots, np.int8), np.zeros(-(-n_slots // LANES), np.uint8)
        self.enriched, self._weight = np.zeros(len(lattice.mesh.cells), bool), np.zeros(len(lattice.mesh.points))
        self.watched = np.zeros(lattice.mesh.n_owned_cells, bool)
        self.cells, self.cell_slots = np.empty(0, np.int32), np.empty((0, len(lattice.template)), np.int64)
        self._positions, self.acting = None, []
        self.broken, self.bond_evaluations, self.particle_steps = 0, 0, 0
        self.seconds = dict.fromkeys(("force", "exchange", "wait", "integrate"), 0.0)
        particles.block[:] = may_not_fail[particles.block]
        self._trigger = np.empty_like(subdomain.bonds.arrays.trigger)
        self._third, self.volume = particles.third, float(particles.volume[0]) if n_slots else 0.0

    def follow(self, patches, weight, displacement, velocity):
        """Take in the particles of newly enriched cells, with the state the mesh has there, and find what is swept. Local.

        Only the surroundings of cells that changed are looked at. weight : (n_vertices,), alpha is its interpolation. displacement, velocity :
        (n_vertices, dim), fresh ghosts included.
        """
        mesh = self.lattice.mesh
        new = patches.enriched & ~self.enriched
        changed = (weight != self._weight)[mesh.cells].any(axis=1)
        self._take_in(np.flatnonzero(new), displacement, velocity)
        self._set_alpha(np.flatnonzero(changed), weight)
        around = patches.around(changed | new)[: mesh.n_owned_cells]
        watched = (patches.enriched & ~patches.whole)[: mesh.n_owned_cells]
        around |= watched != self.watched
        self.enriched, self._weight, self.watched = patches.enriched.copy(), weight.copy(), watched
        ramped = (weight[mesh.cells] > 0.0).any(axis=1)
        self._look_around(np.flatnonzero(around))
        self._hold(np.flatnonzero(patches.around(ramped | patches.enriched) & ~patches.enriched))
        self._positions = self._exchange.restricted(self.inside).bind(self.subdomain.particles.position)
        self.acting = [load.within(self.inside) for load in self.loads]
        self.acting_on_lanes = [LoadOnLanes(load, self.blended) for load in self.acting]

    @cached_property
    def points(self):
        """Points of the enriched owned cells, ascending."""
        return self.lattice.points_of(self.cells, self.density)

    @property
    def n_active(self):
        """Particles of this rank that move by themselves."""
        return self.cell_slots.size

    def _take_in(self, cells, displacement, velocity):
        """Give the particles of new cells the nodal fields, and let them move and fail."""
        mesh, particles = self.lattice.mesh, self.subdomain.particles
        slots, cell, number = self.slots_of(cells)
        self.inside[slots] = True
        particles.block[slots] = self._block[slots]
        values = np.empty((len(slots), mesh.dim))
        interpolate(mesh.cells, cell, number, self.lattice.shape, displacement, values)
        particles.position[slots] = values
        interpolate(mesh.cells, cell, number, self.lattice.shape, velocity, values)
        owned = cell < mesh.n_owned_cells
        particles.velocity[slots[owned]] = values[owned]
        self._inverse_density[slots[owned]] = 1.0 / self.density[particles.block[slots[owned]]]
        mine = np.asarray(cells[cells < mesh.n_owned_cells], np.int32)
        cells, cell_slots = np.concatenate([self.cells, mine]), np.concatenate([self.cell_slots, self.lattice.slots_of(mine)])
        order = np.argsort(cells)
        self.cells, self.cell_slots = cells[order], cell_slots[order]
        self.__dict__.pop("points", None)

    def slots_of(self, cells):
        """Return (slots, cells, numbers in them) of the particles of local cells that this rank holds, (n,) each. Local."""
        return self.lattice.listed(cells)

    def _set_alpha(self, cells, weight):
        """Interpolate alpha in cells; values within round-off of 0 and 1 become these."""
        slots, cell, number = self.slots_of(cells)
        set_alpha(slots, cell, number, self.lattice.mesh.cells, self.lattice.shape, weight, self.alpha)

    def _look_around(self, cells):
        """Find anew what alpha is around the particles of owned cells, and which rows of eight are swept, and how."""
        domain, arrays = self.subdomain, self.subdomain.bonds.arrays
        slots, cell, number = self.slots_of(cells)
        status = np.empty(len(slots), np.int8)
        blend.find_blended(arrays, domain.particles.block, slots, self.alpha, status)
        status[(status == 2) & (~self.inside[slots] | self.watched[cell])] = 1  # not inside: all force is theirs, but functions of the mesh move them
        self._status[slots], self._cell[slots], self._number[slots] = status, cell + 1, number
        mark_rows(slots, self._status, self._inverse_density, self._swept)
        self.rows = rows_with(self._swept, WHOLE, MIXED)
        self.moving = rows_with(self._swept, MOVING, 0)
        self.blended = Blended(rows_with(self._swept, MIXED, 0), self.lattice.padded, self.lattice.mesh.dim)
        by_slot = self._status, self._cell, self._number, self.alpha, self.inside, self._block
        take_lanes(self.blended.rows, *by_slot, self.density, *self.blended.lanes)

    def _hold(self, cells):
        """Let the collar be the particles of `cells`, around the enriched ones, that are ghosts or within reach of alpha > 0."""
        slots, cell, number = self.slots_of(cells)
        prescribed = (cell >= self.lattice.mesh.n_owned_cells) | (self._status[slots] > 0)
        self.collar = Collar(slots[prescribed], cell[prescribed], number[prescribed], self.lattice.mesh.dim)

    def original_block(self, slots):
        """Return the blocks of particles as the scene has them, whether or not they may fail at present. Local."""
        return self._block[slots]

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per sub-step."""
        return self._positions.bytes_sent if self._positions is not None else 0

    def hold_collar(self, velocity, acceleration):
        """Take from nodal fields (n_vertices, dim), ghosts fresh, how the collar moves in the step to come, from where `put_collar` put it. Local."""
        collar, cells = self.collar, self.lattice.mesh.cells
        for nodal, held in ((velocity, collar.velocity), (acceleration, collar.acceleration)):
            interpolate(cells, collar.cell, collar.number, self.lattice.shape, nodal, held)

    def put_collar(self, displacement):
        """Put the collar where the mesh is, displacement (n_vertices, dim) with fresh ghosts: what a look at bonds that reach into it needs. Local."""
        collar = self.collar
        interpolate(self.lattice.mesh.cells, collar.cell, collar.number, self.lattice.shape, displacement, collar.displacement)
        self._place_collar(0.0)

    def start(self, k, tau, time, share=1.0):
        """Begin k sub-steps of tau, s, of velocity Verlet: evaluate the forces at `time`, s, and see which watched cells are strained beyond a share of their limit.

        u and v of the particles, positions of ghosts and of the collar included, are those of the global solution. Local.
        """
        blended, particles = self.blended, self.subdomain.particles
        self.k, self.tau, self.time = k, tau, time
        lanes.remember(blended.rows, particles.position, particles.velocity, blended.before, blended.velocity_before)
        blended.impulse[:] = 0.0
        blended.moment[:] = 0.0
        self._place_collar(0.0)
        np.multiply(share, self.subdomain.bonds.arrays.trigger, out=self._trigger)
        self._forces(0.5 * tau, 0.5 * k * tau**2, time, self.subdomain.bonds.arrays._replace(trigger=self._trigger))

    def run(self):
        """Do the sub-steps; blended impulses are summed on the way, u and v are those of the local run at the end. Collective over neighbours."""
        k, tau, particles = self.k, self.tau, self.subdomain.particles
        self.blended.seen[:] = False
        for j in range(1, k + 1):
            self._drift(0.5 * tau if j == 1 else tau, tau)
            for load in self.acting:
                load.do_work(particles.velocity, self.time + j * tau, tau)
            self._place_collar(j * tau)
            self.refresh()
            self._forces(0.5 * tau if j == k else tau, (k - j) * tau**2, self.time + j * tau, self.subdomain.bonds.arrays)
        self._kick(0.5 * tau)
        self.particle_steps += k * self.n_active

    def add_loads_to_sums(self):
        """Add what loads on blended particles did in the sub-steps of the last run to their impulses and moments. Local."""
        for load in self.acting_on_lanes:
            if load.count:
                load.add_to(self.blended, *sub_step_sums(load.time_function, self.time, self.tau, self.k))

    def refresh(self):
        """Bring the positions of moving ghosts up to date. Collective over neighbours."""
        started = perf_counter()
        self._positions.refresh()
        self.seconds["wait"] += perf_counter() - started

    def _forces(self, weight, moment_weight, time, blended_bonds):
        """Evaluate forces, breaking bonds, and add their blended part, times these weights, to the impulses."""
        started = perf_counter()
        particles = self.subdomain.particles
        self.broken += self._sweep(self.subdomain.bonds.arrays, blended_bonds, self.law, np.array([weight, moment_weight]))
        for load in self.acting:
            load.add_to(particles.force_density, time)
        self.seconds["force"] += perf_counter() - started

    def _sweep(self, bonds, blended_bonds, law, weights):
        """Evaluate forces and add their blended part, times the two weights, to the impulses and moments; return the directed bonds that broke. Local.

        blended_bonds : `bonds` with the trigger of rows to be looked at.
        """
        domain, particles, blended = self.subdomain, self.subdomain.particles, self.blended
        broken = sweeps.bond_forces(bonds, domain.points, law, None, True, self._third, self.rows, particles.force_density, particles.dissipated)
        broken += blend.blended_forces(blended_bonds, domain.points, law, self._third, blended.rows, self.alpha, self._inverse_density,
                                       particles.force_density, particles.dissipated, weights, blended.impulse, blended.moment, blended.seen)
        self.bond_evaluations += LANES * (len(self.rows) + len(blended.rows)) * len(bonds.offset)
        return broken

    def evaluate(self, time=None):
        """Store the present blended forces F^alpha in the impulses, N/m^3, whole ones in force_density, loads at `time`, s, included.

        Collective over neighbours. The collar stands where hold_collar has put it. Without a time there are no loads, and no bond breaks: linear in the
        displacements.
        """
        particles, blended, bonds, law = self.subdomain.particles, self.blended, self.subdomain.bonds.arrays, self.law
        blended.impulse[:] = 0.0
        blended.moment[:] = 0.0
        self._place_collar(0.0)
        self.refresh()
        if time is None:
            bonds, law = bonds._replace(trigger=np.full_like(bonds.trigger, np.inf)), law._replace(break_at=np.full_like(law.break_at, np.inf))
        self.broken += self._sweep(bonds, bonds, law, np.array([1.0, 0.0]))
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
        return np.concatenate([np.empty(0), *(load.work * self.volume for load in self.acting)])

    def work_state(self):
        """Return {key: Entry} of the work accounts."""
        return {f"work/particle_load_{number}": load.work_entry() for number, load in enumerate(self.loads)}

    def look(self, share):
        """Look for bonds of watched cells that are strained beyond a share of their limit, for `wanting` of that share. Local."""
        blend.strained_rows(self.subdomain.bonds.arrays, self.subdomain.points, self.blended.rows, self._inverse_density, share, self.blended.seen)

    def wanting(self, share):
        """Return (n_owned_cells,) bool: watched cells with a particle, of those seen, that is stretched beyond `share` of its limit, or has a broken bond.

        Bonds that broke in the last run are seen, and what `start`, of a share not above this one, or `look` found. Local.
        """
        domain, blended, wanted = self.subdomain, self.blended, np.zeros(len(self.watched), bool)
        lane = (LANES * np.flatnonzero(blended.seen)[:, None] + np.arange(LANES)).ravel()
        cell = blended.cell[lane]
        lane = lane[(cell >= 0) & self.watched[cell]]
        sure = np.empty(len(lane), bool)
        slots = blended.rows[lane // LANES] + lane % LANES
        blend.strained_or_broken(domain.bonds.arrays, domain.points, self.law, self._third, slots, share, sure)
        wanted[blended.cell[lane[sure]]] = True
        return wanted
