"""A scene with a fine region -> its coarse and its fine part, their overlap, and the stepper that couples them."""
import math

import numpy as np

from pdhpc.kernels import shared
from pdhpc.kernels.overlap import words_of
from pdhpc.mts import decomposition
from pdhpc.mts.comparators import BorderView, Collar, MicroContinuity, Subcycling
from pdhpc.mts.decomposition import Split
from pdhpc.mts.interface import CommonBonds, Copies, Interface
from pdhpc.mts.interface_operator import Exact, Kick, Polynomial
from pdhpc.mts.macro_step import MultiTimeStep
from pdhpc.mts.strip import LinearForces, Strip, critical_step
from pdhpc.mts.view import JoinedView
from pdhpc.parallel.comm import agree_on_error, largest, part_of, smallest
from pdhpc.parallel.ghosts import GhostExchange
from pdhpc.parallel.linear_solver import Defaults, LinearSolver
from pdhpc.parallel.partition import Nowhere, share_out
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.lattice_subdomain import make_stencil
from pdhpc.peridynamics.velocity_verlet import VelocityVerlet
from pdhpc.scene.body import calibration_of, make_shape, radius_of
from pdhpc.scene.parts import Part, make_subdomain_of, partition_of, place_points, sample_of
from pdhpc.scene.schema import FINITE_SAFETY

_MOST_STEPS = 1000  # of the fine region in one of the rest
_MARGIN = 0.97  # of the critical step that power iteration finds, which is too large by a part in a hundred at most


class RegionPart(Part):
    """A Part that shares some of its particles with another one.

    Attributes
    ----------
    sharp_dt : s. ramp : (n_slots,) the part's share of each particle. overlap : (n,) int32, slots of its owned copies, in the order of messages.
    """

    def __init__(self, comm, subdomain, body, counts):
        """counts : function points -> (n,) bool, which particles this part counts."""
        super().__init__(comm, subdomain, body)
        self._counts, self.ramp, self.overlap, self.sharp_dt = counts, None, None, np.inf

    def counted(self):
        """Return (n_owned,) bool: the particles that this part counts when each of the body is to be counted once. Local."""
        return self._counts(self.subdomain.places())

    def find_critical_step(self, law):
        """Set sharp_dt, the critical step by power iteration, and critical_dt: the bound of particles that the part holds alone, and 0.97 sharp_dt. Collective.

        The bound of particles in an overlap, whose bonds lie to one side, would be up to 0.6 of that.
        """
        subdomain, found = self.subdomain, np.inf
        if self.comm.allreduce(subdomain.particles.n_owned):
            forces = LinearForces(subdomain, law, self.exchange.bind)
            found = critical_step(subdomain, law, forces, self.comm.allreduce)
        self.sharp_dt = float(f"{found:.5e}")  # rounded: sums over ranks differ in the last bits
        bound, alone = (smallest(self.comm, stable_step(subdomain, law, shared)) for shared in (True, False))
        self.critical_dt = max(bound, min(alone, _MARGIN * self.sharp_dt))

    def settle_bonds(self, law):
        """Make what depends on the bonds that are intact at the start. Collective over the part's ranks."""
        self.subdomain.make_state(law)
        decomposition.share_state(self.subdomain, self.ramp)
        self.refresh_state()


class Regions:
    """The coarse and the fine part of a scene.

    Attributes
    ----------
    parts : [coarse, fine] RegionPart. m : step ratio. copies : GhostExchange from coarse to fine copies.
    """

    def __init__(self, scene, body, comm, split, m, parts, copies):
        self.scene, self.body, self.comm, self.split, self.m, self.parts, self.copies = scene, body, comm, split, m, parts, copies
        self.common_bonds = None

    def check_shape(self):
        """Raise a SceneError, on every rank, unless there are particles in the shape and beyond the overlap. Collective."""
        for part, where in zip(self.parts, ("beyond its overlap", "in it")):
            if self.comm.allreduce(int(part.subdomain.particles.n_owned - len(part.overlap))) == 0:
                raise self.scene.error("fine: shape", f'"{self.scene.fine.shape}" with no particle {where}', "a shape that holds some particles of a body, and not all")

    def critical_macro_dt(self):
        """Return the largest macro step of the coarse region, s. Collective."""
        return self._critical(0)

    def _critical(self, number):
        return self.parts[number].critical_dt_of(self.comm)

    def choose_ratio(self, macro_dt):
        """Return m: the scene's, or the smallest that meets the fine region's critical step and time.error. Collective."""
        if self.scene.fine.step_ratio != "auto":
            return self.m
        return ratio_for(self.scene, self.body, macro_dt, self._critical(1))

    def check(self, macro_dt):
        """Return warnings. Collective.

        Raises
        ------
        SceneError: the fine region's step is above its critical one, or the interface does not fit.
        """
        scene, warnings = self.scene, []
        critical, dt = self._critical(1), macro_dt / self.m
        if dt > critical * (1 + 1e-12) and not scene.time.allow_unstable:
            allowed = f'"auto" or at least {math.ceil(macro_dt / critical)}: the critical step of the region is {critical:.6g} s'
            raise scene.error("fine: step_ratio", f"{self.m}, a step of {dt:.6g} s", allowed)
        if self.interface(macro_dt) == "polynomial" and macro_dt > self.sharp_critical_step():
            found, most = f'"polynomial" with a macro step of {macro_dt:.6g} s', self.sharp_critical_step()
            raise scene.error("fine: interface", found, f'"auto", "exact" or "kick": the operator needs a macro step up to the fine region\'s critical {most:.6g} s')
        if scene.particles.kinematics == "finite" and macro_dt > 1.05 * FINITE_SAFETY * self._critical(0) and scene.method == "mts":
            share = macro_dt / self._critical(0)
            warnings.append(f"the macro step is {share:.2f} of the critical one: above {FINITE_SAFETY} finite deformations may feed energy into the coupling (watched)")
        return warnings

    def sharp_critical_step(self):
        """Return the fine region's critical step, s, by power iteration. Collective."""
        return smallest(self.comm, self.parts[1].sharp_dt)

    def interface(self, macro_dt):
        """Return the way the interface is solved: the scene's, or "polynomial" up to the fine region's critical step and "exact" above it. Collective."""
        chosen = self.scene.fine.interface
        if chosen != "auto":
            return chosen
        return "polynomial" if macro_dt <= self.sharp_critical_step() else "exact"

    def stepper(self, macro_dt):
        """Return the stepper of the scene's method at t = 0. Collective."""
        interface, law = self._make_interface(), self.body.law
        self.common_bonds.take_initial()
        sides = []
        for part, copies, steps in zip(self.parts, (interface.coarse, interface.fine), (1, self.m)):
            sides.append(VelocityVerlet(part.subdomain, law, part.conditions, part.exchange.bind, macro_dt / steps, copies))
        common_bonds = self.common_bonds if np.isfinite(law.break_at).any() else None
        if self.scene.method == "micro":
            stepper = MicroContinuity(*sides, self.m, interface, common_bonds)
            stepper.view = JoinedView(*sides, interface, self.common_bonds)
            return stepper
        operator = self.operator(interface, macro_dt)
        linear = self.scene.particles.kinematics == "linear"
        stiffness = [LinearForces(part.subdomain, law, part.exchange.bind) for part in self.parts] if linear and operator.keeps_multipliers else None
        stepper = MultiTimeStep(*sides, self.m, interface, operator, common_bonds, stiffness)
        stepper.view = JoinedView(*sides, interface, self.common_bonds, operator)
        return stepper

    def _make_interface(self):
        law = self.body.law
        copies = []
        for part, sign in zip(self.parts, (-1, 1)):
            held = np.zeros((len(part.subdomain.particles.position), self.scene.dim), bool)
            for motion in part.conditions.motions:
                held[np.ix_(motion.indices, motion.components)] = True
            share = part.subdomain.particles.mass_share[part.overlap]
            copies.append(Copies(part.subdomain, law, part.overlap, share, held[part.overlap], sign))
        self.common_bonds.coarse, self.common_bonds.fine = copies
        return Interface(self.copies, *copies)

    def operator(self, interface, macro_dt, kind=None, degree=2, order=1, tolerance=1e-8):
        """Return the operator of an interface; kind: default the scene's. degree, order : p and q of the polynomial one; tolerance of CG. Collective."""
        kind = self.interface(macro_dt) if kind is None else kind
        if kind == "kick":
            return Kick(interface, macro_dt, self.m)
        part = self.parts[1]
        reach = 1 if part.subdomain.state is None else 2
        horizons = max(2, min(self.m - 1, math.ceil(2 * macro_dt / self.sharp_critical_step())))  # what a response reaches in a macro step
        strip = Strip(part.subdomain, part.overlap, max(horizons, degree) * reach + reach - 1, part.exchange.bind)
        forces = LinearForces(part.subdomain, self.body.law, part.exchange.bind)
        held = [(motion.indices, motion.components) for motion in part.conditions.motions]
        defaults = Defaults("cg", tolerance) if kind == "exact" else Defaults("richardson", iterations=order + 1)

        def make_solver(n_local, apply, diagonal):
            with agree_on_error(self.comm):  # options may fit none but the systems of some ranks
                return LinearSolver(part.comm, "interface_", defaults, n_local, apply, diagonal)

        if kind == "exact":
            return Exact(interface, macro_dt, self.m, strip, forces, held, make_solver, horizons)
        return Polynomial(interface, macro_dt, self.m, strip, forces, held, make_solver, self.sharp_critical_step(), degree)


def ratio_for(scene, body, macro_dt, critical_dt):
    """Return the smallest m that meets the fine region's critical step and time.error: (pi c dt/delta)^2/24 of the shortest wave that a horizon resolves.

    A wave of length 2 delta, omega = pi c/delta, loses (omega dt)^2/24 of its phase under central differences.
    """
    setting = calibration_of(scene)
    speed = max(material.wave_speed(setting) for material in body.materials)
    stable = macro_dt / (scene.time.safety * critical_dt)
    accurate = math.pi * speed * macro_dt / scene.particles.horizon / math.sqrt(24 * scene.time.error)
    m = max(1, math.ceil(max(stable, accurate) * (1 - 1e-9)))
    if m > _MOST_STEPS:
        raise scene.error("fine: step_ratio", f'"auto", which comes to {m:,}', f"a step ratio up to {_MOST_STEPS}: raise time.error or lower time.dt")
    return m


def split_of(scene, body):
    """Return the Split of a body that a scene's fine region makes. Local."""
    radius = radius_of(scene)
    stencil = None if body.lattice is None else make_stencil(scene.dim, radius / body.lattice.spacing)
    by_points = scene.material[0].model == "lps"
    return Split(make_shape(scene.fine), scene.overlap * radius * (1 + 1e-9), body.spacing, radius, by_points, stencil)


def make_regions(scene, body, comm, m):
    """Return the Regions of a scene whose fine region takes m steps in one of the rest: shared masses, bonds and energies, no cracks yet. Collective."""
    if scene.method == "subcycling":
        return _make_border_regions(scene, body, comm, m)
    split = split_of(scene, body)
    width = split.width
    bodies = [body.seen_through(window) for window in (split.coarse, split.fine)]
    samples = [sample_of(scene, each, comm) for each in bodies]
    works = [max(int(comm.allreduce(int(sample[1].sum()))), 1) * steps for sample, steps in zip(samples, (1, m))]
    counts = (lambda points: split.shape.distance(points) > 0.5 * width), (lambda points: split.shape.distance(points) <= 0.5 * width)
    parts, owners = _make_parts(scene, bodies, comm, samples, works, counts)
    regions = Regions(scene, body, comm, split, m, parts, None)
    regions.copies = _join_copies(comm, split, parts, owners[0])
    _share_out(regions)
    return regions


def _make_parts(scene, bodies, comm, samples, works, counts):
    """Return ([RegionPart], [function points -> rank that owns them]) of two regions over ranks that share their work evenly. Collective."""
    parts, owners = [], []
    for each, sample, (first, shares), counted in zip(bodies, samples, share_out(works, comm.size), counts):
        partition = partition_of(scene, each, comm, sample, shares)
        leaf = comm.rank - first
        takes_part = 0 <= leaf < len(shares)
        ranks = part_of(comm, takes_part)
        held = place_points(each, comm, partition, radius_of(scene), first)
        subdomain = make_subdomain_of(scene, held, partition if takes_part else Nowhere(), comm, leaf if takes_part else 0)
        parts.append(RegionPart(ranks, subdomain, held, counted))
        owners.append(lambda points, partition=partition, first=first: partition.owner(points) + first)
    return parts, owners


def _join_copies(comm, split, parts, coarse_owner):
    """Find the copies of the overlap, in the order of messages, and return the GhostExchange from the coarse to the fine ones. Collective."""
    found = []
    for part in parts:
        particles = part.subdomain.particles
        found.append(np.flatnonzero(split.overlap(part.subdomain.places())) if particles.n_owned else np.empty(0, np.int64))
    coarse, fine = (part.subdomain.particles for part in parts)
    owner = coarse_owner(parts[1].subdomain.places(found[1])) if len(found[1]) else np.empty(0, np.int64)
    order = np.lexsort((fine.id[found[1]], owner))
    found[1], owner = found[1][order], owner[order]
    for part, members in zip(parts, found):
        part.overlap = part.subdomain.particles.slots[members].astype(np.int32)
    return GhostExchange(comm, coarse.id[found[0]], fine.id[found[1]], owner)


def _share_out(regions):
    """Share bonds (or point energies) by the ramp and masses in proportion to stiffness, from the unbroken body. Collective."""
    law, split = regions.body.law, regions.split
    shares = split.coarse_share, lambda points: 1.0 - split.coarse_share(points)
    own = []
    for part, share in zip(regions.parts, shares):
        subdomain = part.subdomain
        subdomain.share_rows(part.overlap)
        part.ramp = decomposition.shares_by_slot(subdomain, share)
        subdomain.make_state(law)
        decomposition.share_bonds(subdomain, law, part.ramp, part.overlap)
        part.refresh_state()
        own.append(decomposition.stiffnesses(subdomain, law, part.overlap))
    n = len(own[0])
    field = np.zeros((n + len(own[1]), 1))
    field[:n, 0] = own[0]
    bound = regions.copies.bind(field)
    bound.refresh()
    fine = decomposition.mass_share(own[1], field[n:, 0])
    field[:n], field[n:, 0] = 0.0, 1.0 - fine
    bound.accumulate()
    bound.free()
    for part, mass in zip(regions.parts, (field[:n, 0], fine)):
        particles = part.subdomain.particles
        particles.mass_share = np.ones(len(particles.position))
        particles.mass_share[part.overlap] = mass
        shared.set_over_masses(part.subdomain.shared, part.overlap, 1.0 / mass)
    regions.common_bonds = _common_bonds(regions)


def _common_bonds(regions):
    """Return the CommonBonds of the unbroken body. Collective."""
    inside = []
    for part in regions.parts:
        particles = part.subdomain.particles
        marks = np.zeros(len(particles.position), bool)
        slots = np.concatenate([particles.slots, particles.ghost_slots])
        if len(slots):
            marks[slots] = regions.split.overlap(part.subdomain.places_at(slots))
        inside.append(marks)
    arrays = [part.subdomain.bonds.arrays for part in regions.parts]
    longest = max(int(np.diff(each.row_start).max(initial=0)) if hasattr(each, "row_start") else 0 for each in arrays)
    n_words = int(largest(regions.comm, max(words_of(each, longest) for each in arrays)))
    copies = [_Bare(part) for part in regions.parts]
    return CommonBonds(regions.copies, *copies, inside, n_words)


class _Bare:
    """The copies of a part before their masses and conditions are known."""

    def __init__(self, part):
        self.slots, self.subdomain = part.overlap, part.subdomain


class BorderRegions(Regions):
    """Regions that meet without overlap, for Subcycling. own : of both parts, (n_owned,) bool, which particles are not copies of the other's."""

    def interface(self, macro_dt):
        """Return "none"."""
        return "none"

    def stepper(self, macro_dt):
        """Return the Subcycling at t = 0. Collective."""
        sides = []
        for part, steps in zip(self.parts, (1, self.m)):
            sides.append(VelocityVerlet(part.subdomain, self.body.law, part.conditions, part.exchange.bind, macro_dt / steps))
        collars = [Collar(exchange, source.subdomain, slots, target.subdomain)
                   for (exchange, slots), source, target in zip(self.copies, self.parts, self.parts[::-1])]
        stepper = Subcycling(*sides, self.m, collars)
        stepper.view = BorderView(stepper, [part.counted() for part in self.parts])
        return stepper


def _make_border_regions(scene, body, comm, m):
    """Return the BorderRegions of a scene: each part holds its own particles and copies of the other's within a family radius. Collective."""
    radius = radius_of(scene)
    split = Split(make_shape(scene.fine), radius * (1 + 1e-9), body.spacing, radius, False)
    bodies = [body, body.seen_through(split.fine)]
    samples = [sample_of(scene, each, comm) for each in bodies]
    own = (lambda points: split.shape.distance(points) > 0.0), (lambda points: split.shape.distance(points) == 0.0)
    works = [max(int(comm.allreduce(int(weights[mine(points)].sum()))), 1) * steps for (points, weights), mine, steps in zip(samples, own, (1, m))]
    samples = [(points[mine(points)], weights[mine(points)]) for (points, weights), mine in zip(samples, own)]
    parts, owners = _make_parts(scene, bodies, comm, samples, works, own)
    collars = []
    for part, other, owner, mine in zip(parts[::-1], parts, owners, own[::-1]):
        particles = part.subdomain.particles
        copies = np.flatnonzero(~mine(part.subdomain.places())) if particles.n_owned else np.empty(0, np.int64)
        ranks = owner(part.subdomain.places(copies)) if len(copies) else np.empty(0, np.int64)
        order = np.lexsort((particles.id[copies], ranks))
        exchange = GhostExchange(comm, other.subdomain.particles.id[: other.subdomain.particles.n_owned], particles.id[copies][order], ranks[order])
        collars.append((exchange, particles.slots[copies][order].astype(np.int32)))
        particles.mass_share = np.zeros(len(particles.position))
        particles.mass_share[particles.slots[mine(part.subdomain.places())]] = 1.0
        part.subdomain.keep_rows(mine)
        part.overlap, part.ramp = collars[-1][1], particles.mass_share
    regions = BorderRegions(scene, body, comm, split, m, parts, collars)
    return regions
