"""Compile the kernels of a run on a tiny body, so that one process per node fills the cache before the others read it."""
import contextlib
import itertools
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.conditions.conditions import ParticleConditions
from pdhpc.conditions.impactors import PLANE, Impactor
from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.conditions.time_functions import Constant
from pdhpc.fem.cell_points import compile_cells
from pdhpc.geometry.cracks import disk, polyline
from pdhpc.geometry.lattice import LatticeBody, find_common_lattice
from pdhpc.geometry.shapes import Box
from pdhpc.kernels import motion, shared
from pdhpc.kernels.bond_states import count_face, foremost_damaged
from pdhpc.kernels.contact import ContactLaw
from pdhpc.kernels.neighbours import count_neighbours
from pdhpc.kernels.overlap import words_of
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.failure import EnergyLimit, PairEnergyLimit, ScatteredLimit, SoftenedLimit
from pdhpc.materials.law import PairWeighting, Setting
from pdhpc.materials.state_based import LinearSolid
from pdhpc.mts import decomposition
from pdhpc.mts.interface import CommonBonds, Copies, Interface
from pdhpc.mts.interface_operator import Exact, Polynomial
from pdhpc.mts.strip import LinearForces, Strip
from pdhpc.parallel.comm import compile_exact_sum
from pdhpc.parallel.exact import ExactSums
from pdhpc.parallel.ghosts import compile_messages
from pdhpc.parallel.linear_solver import SolverError
from pdhpc.parallel.partition import Partition
from pdhpc.parallel.vicinity import Vicinity
from pdhpc.peridynamics.bonds import cut_by_cracks
from pdhpc.peridynamics.contact import Contact
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.crowding import find_close, find_crowded
from pdhpc.peridynamics.equilibrium import LoadPath
from pdhpc.peridynamics.fields import field, strain_energy_density
from pdhpc.peridynamics.impact import Impact, depths
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.lattice_subdomain import make_lattice_subdomain, sample_lattice
from pdhpc.peridynamics.newton import Newton
from pdhpc.peridynamics.pieces import label_pieces
from pdhpc.peridynamics.relaxation import Relaxation
from pdhpc.peridynamics.subdomain import make_subdomain, mark_mixed
from pdhpc.peridynamics.surface import correct_surfaces
from pdhpc.scene.body import law_of, path_of
from pdhpc.scene.face_area import area_over_volume

PATHS, MODELS = ("lattice", "cloud"), ("pmb", "lps")


class NoGhosts:
    """What refreshes the ghosts of a body that one process holds: there are none."""

    def __init__(self, field):
        """field : not used."""

    def start_refresh(self):
        """Do nothing."""

    def finish_refresh(self):
        """Do nothing."""

    refresh = accumulate = free = finish_refresh


class Variant(NamedTuple):
    """Which kernels of a law and storage a scene uses beside the plain ones.

    horizons : they differ between bodies. correction : of surfaces, a name. failure : "stretch" or "energy". softening : of the critical stretch. modulus :
    Weibull's, of its scatter. influence : a name, for measuring.
    """

    horizons: bool = False
    correction: str = "none"
    failure: str = "stretch"
    softening: float = 0.0
    modulus: Optional[float] = None
    influence: str = "constant"


def compile_scene(scene, comm):
    """Compile the kernels that a scene uses; comm : of this process alone. Local."""
    if scene.uses_mesh:
        from pdhpc.scene.mesh_warm_up import compile_coupled, compile_mesh

        (compile_mesh if scene.model == "fem" else compile_coupled)(scene, comm)
    if scene.model != "fem":
        path, model, linear = path_of(scene), scene.material[0].model, scene.particles.kinematics == "linear"
        variant = variant_of(law_of(scene), scene.particles.surface_correction)
        compile_kernels((scene.dim,), (path,), (model,), (linear,), variant)
        if scene.stands_still:
            compile_equilibrium(scene.dim, path, model, linear, variant)
        elif scene.method != "single":
            compile_coupling(scene.dim, path, model, linear)
        if scene.fragments is not None:
            compile_fragments(scene.dim, path, variant)
        if scene.brings_points:
            compile_points(scene.dim, comm)
        if scene.contact is not None or scene.impactor:
            contact = scene.contact
            compile_interactions(scene.dim, path, model, comm, contact is not None and (contact.friction > 0 or contact.damping > 0), variant)


def variant_of(law, correction):
    """Return the Variant of a law and the name of a surface correction."""
    energy = isinstance(law.failure, (EnergyLimit, PairEnergyLimit))
    softening, modulus = float(isinstance(law.failure, SoftenedLimit)), 10.0 if isinstance(law.failure, ScatteredLimit) else None
    return Variant(isinstance(law.weighting, PairWeighting), correction, "energy" if energy else "stretch", softening, modulus)


def block(dim, cells, ratio, linear=False, path="lattice", model="pmb", variant=Variant()):
    """Return (Subdomain, law) of a small cube of `cells` per side, family radius `ratio` spacings: for warming up and for measuring kernels. Local."""
    spacing = 1e-3
    bodies = [LatticeBody(Box((0.0,) * dim, (cells * spacing,) * dim), spacing, 0)]
    setting = Setting("3d" if dim == 3 else "plane_stress", ratio * spacing, 1.0, variant.influence, spacing, "none", linear)
    kind, moduli = (BondBased, (200e9,)) if model == "pmb" else (LinearSolid, (160e9, 80e9))
    material = kind("steel", 7800.0, *moduli, 1e4, failure=variant.failure, stretch_softening=variant.softening, weibull_modulus=variant.modulus)
    blocks, settings = [(material, True)], [setting]
    if variant.horizons:
        blocks, settings = 2 * blocks, [setting, setting._replace(horizon=0.9 * setting.horizon)]
    law = kind.law(blocks, settings)
    whole = Partition(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), 1)
    radius = ratio * (1 + 1e-9) * spacing

    def describe(points, number, ids):
        return np.full(len(points), spacing**dim), np.zeros(len(points), np.uint8)

    if path == "lattice":
        subdomain = make_lattice_subdomain(bodies, find_common_lattice(bodies)[0], whole, 0, radius, describe, law, linear)
    else:
        subdomain = make_subdomain(bodies, whole, 0, np.array([[radius]]) if variant.horizons else radius, describe, linear)
    if variant.correction != "none":
        correct_surfaces(subdomain, law, blocks, settings, NoGhosts, variant.correction)
    subdomain.make_state(law)
    return subdomain, law


def compile_kernels(dims=(2, 3), paths=PATHS, models=MODELS, kinematics=(False, True), variant=Variant()):
    """Call every kernel of a run once for each choice of dimension, path, model and kinematics (linear or not). Local."""
    for choice in itertools.product(dims, paths, models, kinematics):
        _compile(*choice, variant)


def compile_fragments(dim, path, variant=Variant()):
    """Call the kernels that find what holds together once. Local."""
    subdomain, _ = block(dim, 4, 2.0, path=path, variant=variant)
    label_pieces(subdomain, NoGhosts, int, np.ones(subdomain.particles.n_owned, bool))
    compile_messages(np.zeros((len(subdomain.particles.position), 1), np.int64))


def compile_coupling(dim, path, model, linear):
    """Call every kernel of the coupling of two regions once. Local."""
    subdomain, law = block(dim, 4, 2.0, linear, path, model)
    particles = subdomain.particles
    slots, bind = particles.slots[:2], NoGhosts
    subdomain.share_rows(slots)
    ramp = np.full(len(particles.position), 0.5)
    decomposition.share_bonds(subdomain, law, ramp, slots)
    decomposition.stiffnesses(subdomain, law, slots)
    shared.set_over_masses(subdomain.shared, slots, np.full(2, 2.0))
    stable_step(subdomain, law)
    strain_energy_density(subdomain, law)
    InternalForces(subdomain, law, bind).evaluate()
    particles.mass_share = np.ones(len(particles.position))
    copies = [Copies(subdomain, law, slots, np.full(2, 0.5), np.zeros((2, dim), bool), sign) for sign in (-1, 1)]
    exchange = NoExchange()
    common = CommonBonds(exchange, *copies, [ramp > 0.0] * 2, words_of(subdomain.bonds.arrays, 64))
    common.unify()
    interface = Interface(exchange, *copies)
    interface.start_multipliers()
    interface.velocity_gap()
    interface.largest_gap()
    strip = Strip(subdomain, slots, 5, bind)  # state-based laws reach that far
    for make in (Exact, lambda *arguments: Polynomial(*arguments, 1.0)):
        operator = make(interface, 1e-9, 3, strip, LinearForces(subdomain, law, bind), [], lambda n, apply, diagonal: None)
        operator.apply(np.zeros((2, dim)))
        operator.respond(np.zeros((2, dim)))
    for name in ("stress", "strain"):
        field(name, subdomain, law)
    compile_messages(np.zeros((1, dim)), np.zeros((1, 1), np.uint64), np.zeros((1, dim + 1))[:, :dim], np.zeros((dim, 1)).T)


def compile_points(dim, comm):
    """Call every kernel of bodies from files once. Collective over `comm`."""
    compile_cells(dim)
    subdomain, _ = block(dim, 4, 2.0, path="cloud")
    points, volume = subdomain.places(), np.full(subdomain.particles.n_owned, 1e-3**dim)
    find_crowded(subdomain, np.full(len(volume), 1e-3), np.zeros(len(volume), np.int64), np.full((1, 1), 1e-8))
    area_over_volume(comm, points, volume, 1.0, 0)


def compile_interactions(dim, path, model, comm, resists, variant=Variant()):
    """Call every kernel of contact (resists: with friction or damping) and of impactors once; comm : of this process alone. Local."""
    subdomain, law = block(dim, 4, 2.0, False, path, model, variant)
    particles = subdomain.particles
    particles.place()
    friction, force_density = 0.1 if resists else 0.0, particles.force_density
    contact_law = ContactLaw(np.ones((1, 1)), np.array(law.density, float), friction, 0.0, 1.0)
    contact = Contact(subdomain, law, contact_law, lambda volume: np.full(len(volume), 0.6e-3), Vicinity(comm), 0.3e-3)
    floor = Impactor("floor", (PLANE, np.eye(3)[0], 0.0, np.inf), np.zeros(dim), np.zeros(dim), Constant(), 1.0)
    ones = np.ones(particles.n_owned)
    impact = Impact(subdomain, floor, (1e-3 * ones, ones, ones), friction, 1.0, ExactSums(comm, dim + 1))
    depths(floor, subdomain.places(), 1e-3 * ones)
    for each in (contact, impact):
        each.add_to(force_density, 0.0, 0)
        each.moved(0.0)
        each.ledger()
    contact.measure_stiffness()
    compile_messages(np.zeros((1, dim)), np.zeros((1, 2 * dim)))


def compile_equilibrium(dim, path, model, linear, variant=Variant()):
    """Call every kernel of bodies that stand still once. Local."""
    compile_fragments(dim, path, variant)
    subdomain, law = block(dim, 4, 2.0, linear, path, model, variant)
    particles = subdomain.particles
    subdomain.particles.place()
    conditions = ParticleConditions(particles, law.density, [], [PrescribedMotion(particles.slots[:1], [0], [0.0], Constant(), "displacement")])
    sums, path = Alone(), LoadPath(1.0, 0.5, 2, variant.failure == "stretch" and not variant.softening and variant.modulus is None, 1, 1e-3, 1)
    relaxation, newton = (method(subdomain, law, conditions, NoGhosts, sums, path) for method in (Relaxation, Newton))
    with contextlib.suppress(SolverError):  # of rounding, which no iteration brings to rest
        relaxation.advance()
    for part in (relaxation._damping, lambda: relaxation._account(True), relaxation._break_bonds):
        part()
    newton.make_solver(lambda n, apply, blocks: apply(np.zeros(n)))


class Alone:
    """The sums of one process."""

    def of(self, values):
        """Return the sum of each row."""
        return values.sum(axis=1)

    def count(self, number):
        """Return the number."""
        return number

    largest = count


class NoExchange:
    """The exchange of copies that lie in the same slots: nothing is copied."""

    def bind(self, field):
        """Return what does nothing."""
        return NoGhosts(field)


def _compile(dim, path, model, linear, variant):
    subdomain, law = block(dim, 4, 2.0, linear, path, model, variant)
    particles, arrays, points = subdomain.particles, subdomain.bonds.arrays, subdomain.points
    slots = particles.slots
    if path == "lattice":
        body = LatticeBody(Box((0.0,) * dim, (2e-3,) * dim), 1e-3, 0)
        sample_lattice([body], find_common_lattice([body])[0], 0, 1, 2e-3)
    else:
        count_neighbours(particles.reference, 1, 2e-3)
        mark_mixed(arrays.row_start, arrays.neighbour, particles.volume, particles.block, points.row_block)
        find_close(subdomain, particles.volume, np.zeros(len(particles.volume), np.int64))
    cut_by_cracks(subdomain.bonds, points, polyline([[-1.0, -1.0], [-1.0, -2.0]]) if dim == 2 else disk([-1.0] * 3, [1.0, 0, 0], 0.1))
    count_face(arrays, points, particles.third, slots, np.ones(len(particles.position), bool), 0, 1e-3)
    stable_step(subdomain, law)
    subdomain.bonds.alive()
    subdomain.bonds.set_states(subdomain.bonds.states())
    foremost_damaged(arrays, slots, subdomain.bonds.initial_size, 0.5, np.arange(2), np.zeros(2))
    subdomain.places()
    particles.place()
    InternalForces(subdomain, law, NoGhosts).evaluate()
    inverse_density = np.zeros(256)
    particles.kick(inverse_density, 0.0)
    particles.drift(0.0)
    particles.kick_drift(inverse_density, 0.0, 0.0)
    motion.first_not_finite(particles.displacement, slots)
    motion.kinetic_energies(particles.velocity, particles.volume, particles.block, law.density, slots, np.empty(len(slots)))
    strain_energy_density(subdomain, law)
    compile_exact_sum()
    for name in ("stress", "strain"):
        field(name, subdomain, law)
    _compile_loads(particles)


def _compile_loads(particles):
    load = BodyForce(particles.slots[:1], np.zeros((1, particles.dim)), Constant())
    load.add_to(particles.force_density, 0.0)
    load.do_work(particles.velocity, 0.0, 1.0)
    motion = PrescribedMotion(particles.slots[:1], [0], [0.0], Constant(), "velocity")
    motion.steer(particles.displacement, particles.velocity, 0.0, 1.0)
    motion.settle(particles.velocity, 0.0)
    motion.do_work(particles.force_density, particles.velocity, 1.0)
