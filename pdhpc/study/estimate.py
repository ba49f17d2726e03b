"""What a scene would cost: counted and built where it is small, estimated from a sample where it is large."""
import math
import time
from typing import List, NamedTuple, Tuple

import numpy as np

from pdhpc.geometry.points import PointBody
from pdhpc.kernels.family import VARIED
from pdhpc.kernels.neighbours import LANES
from pdhpc.kernels.lattice import WORD
from pdhpc.parallel.comm import world
from pdhpc.parallel.partition import share_out
from pdhpc.materials.failure import PAIR_ENERGY_FORMULA, critical_pair_energy
from pdhpc.materials.law import reach_of
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.peridynamics.view import View
from pdhpc.scene.body import kinds_by_body, make_body, radius_of, select
from pdhpc.scene.build import build
from pdhpc.scene.amounts import Amount, amount, amounts_of
from pdhpc.scene.clearance import check_clear_of
from pdhpc.scene.gauges import make_gauges
from pdhpc.scene.interactions import contact_distance, contact_modulus, penalty, sizes_of, stiffer_step
from pdhpc.scene.mesh_rules import unused
from pdhpc.scene.remarks import overlaps, remarks_on
from pdhpc.scene.regions import ratio_for, split_of
from pdhpc.scene.static import load_path
from pdhpc.scene.steps import choose_step
from pdhpc.warm_up import NoGhosts, block, variant_of

_BYTES_PER_SLOT = 12.125  # neighbour, inverse length, bond state
_BYTES_PER_PARTICLE = {2: 122, 3: 180}
_BYTES_PER_CELL = {2: 73, 3: 105}  # of a lattice, and 8 for each word of bond states
_STATE_BYTES = {"pmb": 0, "lps": 16}
_FACTOR_BYTES = 8  # of a bond slot: its surface correction
_LIMIT_BYTES = 8  # of a particle whose critical stretch rises with compression, or scatters
_CONTACT_BYTES = {2: (160, 44, 32), 3: (230, 108, 60)}  # of a particle while a list is made: of all, where bonds can break, with friction or damping
_CONTACT_SECONDS = 8e-8  # a particle's share of a list of near pairs, made anew every 20 steps
_MICROMODULUS = {"3d": "18 K/(pi horizon^4)", "plane_stress": "9 E/(pi thickness horizon^3)", "plane_strain": "48 E/(5 pi thickness horizon^3)"}
_SMALL = 1.2e7  # directed bonds up to which the body is built
_SLAB_POINTS = 1 << 20
_BYTES_PER_FILE_CELL = 430  # of a mesh file while rank 0 deals it out
_BYTES_PER_FILE_POINT = {2: 80, 3: 96}  # of a body from a file, at home and where it is used


class RegionEstimate(NamedTuple):
    """A region with a step of its own: share of the work of a macro step; ranks : (first, last) that have a part of it."""

    name: str
    particles: int
    bonds: int
    share: float
    critical_dt: float
    dt: float
    ranks: Tuple[int, int]


class Estimate(NamedTuple):
    """Cost of a scene on `ranks` ranks; `exact` when the body was built."""

    exact: bool
    particles: int
    bonds: int
    neighbours: int
    critical_stretch: List[Tuple[str, str]]
    critical_dt: float
    dt: float
    steps: int
    ranks: int
    memory: float  # bytes per rank
    rate: float  # bonds per second and core
    seconds: float
    warnings: List[str]
    path: str
    regions: List[RegionEstimate]  # none without a fine region
    step_ratio: int
    overlap: int  # particles that both regions hold
    undivided_dt: float  # critical step of the body as one
    contact: List[Tuple[str, str]]  # what "auto" is for contact and impactors; none without
    evaluations: int = 0  # of forces in an equilibrium of bodies that stand still
    bodies: List[Amount] = []


def estimate(scene, ranks=None):
    """Return the Estimate of a scene. Raises SceneError as a run would. Local to one process."""
    from mpi4py import MPI

    comm = world()
    ranks = ranks or comm.size
    body = make_body(scene, MPI.COMM_SELF)
    ratio = radius_of(scene) / body.spacing
    family = family_size(scene.dim, ratio)
    cells = sum(_cells(lattice) for lattice in body.lattices)
    exact = cells * family <= _SMALL
    whole = scene if scene.stands_still else scene.model_copy(update={"time": scene.time.model_copy(update={"method": "single"}), "fine": None})
    if exact:
        amounts, bonds, neighbours, critical, warnings = _built(whole, ranks)
    else:
        amounts, bonds, neighbours, critical, warnings = _sampled(whole, body, family)
    particles = sum(each.particles for each in amounts)
    regions, m, overlap, evaluations = [], 1, 0, 0
    if scene.stands_still:
        path = load_path(scene, body)
        dt, steps, more, evaluations = path.dt, scene.load_steps, [], _evaluations(scene, body, path, critical)
    elif scene.method != "single":
        regions, m, overlap, dt, steps, more = _regions(scene, body, ranks, exact, family, critical)
    else:
        dt, steps, more = choose_step(scene, critical)
    varied = any(lattice.sizes[0] < lattice.sizes[2] for lattice in body.lattices if isinstance(lattice, PointBody))
    rate = kernel_rate(scene, ratio, body.path.split(":")[0], body.law, varied)
    memory = particles / ranks * (_bytes_per_particle(scene, body, neighbours, ratio, particles / ranks) + _equilibrium_bytes(scene)) + _bytes_of_files(scene, body, ranks)
    work = sum(steps * region.bonds for steps, region in zip((1, m), regions)) if regions else bonds
    seconds = 2 * work * steps * max(evaluations, 1) / (rate * ranks)
    if scene.contact is not None:
        seconds += _CONTACT_SECONDS * particles * steps / ranks
    stretch = critical_stretches(scene, body)
    warnings = list(dict.fromkeys(unused(scene) + warnings + remarks_on(scene, body, amounts) + more))
    smallest = min([critical, *(region.critical_dt for region in regions)])
    return Estimate(exact, particles, bonds, neighbours, stretch, smallest, dt, steps, ranks, memory, rate, seconds, warnings, body.path, regions, m, overlap, critical,
                    contact_settings(scene, body), evaluations, amounts)


def _evaluations(scene, body, path, critical):
    """Return about how many evaluations of forces an equilibrium takes.

    Damped critically, a motion of frequency w fades like exp(-w t); of the slowest, a stretch of the longest side L with one end held, w = pi c/(2 L), and
    relaxation takes the body's own critical steps where it is uniform: n = ln(1/tolerance)/(w dt). CG takes about half of it, twice that in finite kinematics, where an
    iteration takes two evaluations, and Newton two of them.
    """
    speed = max(body.materials[number].wave_speed(setting) for number, setting in body.kinds)
    count = math.log(1.0 / path.tolerance) * 2 * path.length * path.spacing / (math.pi * speed * critical)
    share = 1.0 if scene.method == "relaxation" else 0.5 if scene.particles.kinematics == "linear" else 2.0
    return max(1, round(share * count))


def _equilibrium_bytes(scene):
    """Return the memory of a particle that equilibria need beside that of steps in time: fields by component, preconditioner and Krylov vectors."""
    if not scene.stands_still:
        return 0
    fields = 13 if scene.method == "relaxation" else 20 + scene.dim
    return 8 * (fields * scene.dim + 12)


def _regions(scene, body, ranks, exact, family, critical):
    """Return ([RegionEstimate], m, particles of the overlap, macro step, number of them, warnings) of a scene with a fine region."""
    from mpi4py import MPI

    if exact:
        problem = build(scene, MPI.COMM_SELF)
        counts = [(part.subdomain.particles.n_owned, part.subdomain.bonds.n_directed // 2, part.critical_dt) for part in problem.parts]
        m, dt, steps, warnings, overlap = problem.m, problem.dt, problem.n_steps, problem.warnings, len(problem.parts[1].overlap)
    else:
        found = split_of(scene, body)
        counts = [(number, number * family // 2, critical) for number in (_count(body.seen_through(window)) for window in (found.coarse, found.fine))]
        dt, steps, warnings = choose_step(scene, critical)
        m = scene.fine.step_ratio if scene.fine.step_ratio != "auto" else ratio_for(scene, body, dt, critical)
        overlap = sum(count[0] for count in counts) - _count(body)
    works = [counts[0][1], m * counts[1][1]]
    regions = []
    for name, count, work, step, (first, shares) in zip(("coarse", "fine"), counts, works, (dt, dt / m), share_out(works, ranks)):
        regions.append(RegionEstimate(name, count[0], count[1], work / max(sum(works), 1), count[2], step, (first, first + len(shares) - 1)))
    return regions, m, overlap, dt, steps, warnings


def _count(body):
    """Return the number of particles of a body."""
    return sum(len(points) for lattice in body.lattices for _, points in _slabs(lattice))


def _cells(lattice):
    """Return the number of cells of a LatticeBody's box, or of points of a PointBody."""
    return lattice.count if isinstance(lattice, PointBody) else int(np.prod(lattice.cells, dtype=object))


def _bytes_of_files(scene, body, ranks):
    """Return the memory that the points of files take on a rank, on the first one with what it reads."""
    dealt = sum(lattice.count for lattice in body.lattices if isinstance(lattice, PointBody)) / ranks * _BYTES_PER_FILE_POINT[scene.dim]
    rows = [lattice.last_id - lattice.first_id for table, lattice in zip(scene.body, body.lattices) if table.shape == "mesh"]
    return dealt + max(rows, default=0) * _BYTES_PER_FILE_CELL


def _bytes_per_particle(scene, body, neighbours, ratio, per_rank):
    """Return the memory of a particle and its bonds; on a lattice the padding of a compact share of `per_rank` particles counts too."""
    extra = _STATE_BYTES[scene.material[0].model] + _contact_bytes(scene)
    extra += _LIMIT_BYTES if any(material.stretch_softening or material.weibull_modulus for material in scene.material) else 0
    if body.lattice is None:
        slot = _BYTES_PER_SLOT + (_FACTOR_BYTES if scene.particles.surface_correction != "none" else 0)
        return math.ceil(neighbours / LANES) * LANES * slot + _BYTES_PER_PARTICLE[scene.dim] + extra
    side = max(per_rank, 1.0) ** (1 / scene.dim)
    padding = (1 + 2 * int(ratio) / side) ** (scene.dim - 1) * (1 + (2 * LANES + int(ratio)) / side)
    words = math.ceil(family_size(scene.dim, ratio) / WORD)
    return padding * (_BYTES_PER_CELL[scene.dim] + 8 * words + extra) + 16


def _contact_bytes(scene):
    """Return the memory of a particle for contact, lists in the making included, and for impactors."""
    extra = len(scene.impactor) * (8 * scene.dim + 50)
    if scene.contact is not None:
        breaks = any(material.energy_release_rate is not None or material.critical_stretch is not None for material in scene.material)
        resists = scene.contact.friction > 0 or scene.contact.damping > 0
        extra += sum(number for number, counts in zip(_CONTACT_BYTES[scene.dim], (True, breaks, resists)) if counts)
    return extra


def contact_settings(scene, body):
    """Return [(name, value and formula)] of what contact and impactors take for "auto"."""
    rows, kinds, sizes = [], kinds_by_body(scene), [sizes_of(lattice) for lattice in body.lattices]
    if scene.contact is not None:
        for size in sorted({size for both in sizes for size in both} if scene.contact.distance == "auto" else {0.0}):
            rows.append(("contact distance", f"{contact_distance(scene, size):.6g} m" + (f" = 1.35 {'spacing' if len(set(sizes)) == 1 else f'times {size:g} m'}" if size else "")))
        for number, horizon in dict.fromkeys((number, setting.horizon) for number, setting in body.kinds):
            formula = f" = 15 times {_MICROMODULUS[scene.dimension]}" if scene.contact.stiffness == "auto" else ""
            rows.append(("contact stiffness", f"{body.materials[number].name}: {contact_modulus(scene, body.materials[number], horizon):.6g} N/m^6{formula}"))
    for impactor in scene.impactor:
        for number, size in dict.fromkeys((number, size) for (number, _), both in zip(kinds, sizes) for size in both):
            formula = " = E/spacing^2" if impactor.stiffness == "auto" else ""
            rows.append(("impactor stiffness", f"{impactor.name} on {body.materials[number].name}: {penalty(impactor, body.materials[number], size):.6g} N/m^4{formula}"))
    return rows


def _built(scene, ranks):
    """Build the body in this process and count."""
    from mpi4py import MPI

    problem = build(scene, MPI.COMM_SELF)
    critical = problem.parts[0].critical_dt if scene.stands_still else problem.critical_dt
    make_gauges(problem, View(problem.subdomain, problem.body.law), MPI.COMM_SELF)
    bonds = problem.subdomain.bonds
    warnings = [] if ranks <= problem.subdomain.particles.n_owned else [f"{ranks} ranks for {problem.subdomain.particles.n_owned} particles: some own nothing"]
    more = problem.warnings if scene.stands_still else overlaps(scene, problem.body, problem.parts[0], MPI.COMM_SELF)
    return amounts_of(scene, problem.body, problem.parts, MPI.COMM_SELF), bonds.n_directed // 2, int(bonds.family_size.max(initial=0)), critical, warnings + more


def _sampled(scene, body, family):
    """Count particles slab by slab, check that every region holds one, and take bonds and step from whole families."""
    names = {name for name in _region_names(scene) if name != "all"}
    amounts, bonds = [], 0
    own = np.diag(np.broadcast_to(body.reach, (len(body.lattices),) * 2))
    for lattice_number, lattice in enumerate(body.lattices):
        whole = family_size(scene.dim, own[lattice_number] / lattice.spacing)
        particles = 0
        for ids, points in _slabs(lattice):
            particles, bonds = particles + len(points), bonds + len(points) * whole
            numbers = np.full(len(points), lattice_number)
            check_clear_of(scene, lattice_number, lattice, ids, points)
            names = {name for name in names if not select(scene, body, name, points, numbers, ids).any()}
        volume = float(lattice.volume.sum()) if isinstance(lattice, PointBody) else particles * body.volumes[lattice_number]
        amounts.append(amount(scene, body, lattice_number, particles, volume))
    if names:
        raise scene.error("region", f'"{sorted(names)[0]}", which selects no particle', "a region that holds at least one")
    return amounts, bonds // 2, family, stiffer_step(scene, body, _family_step(scene, body)), []


def _region_names(scene):
    used = [each.region for group in (scene.load, scene.initial, scene.tip) for each in group]
    return used + [probe.region for probe in scene.probe if probe.region is not None] + list(scene.damage.no_fail)


def _slabs(lattice):
    """Yield the (ids, points) of a body in pieces of bounded size."""
    if isinstance(lattice, PointBody):
        yield lattice.points_in(-np.inf, np.inf)
        return
    centres = lattice.centres(0)
    layer = int(np.prod(lattice.cells[1:]))
    per_slab = max(1, _SLAB_POINTS // layer)
    dim = len(lattice.cells)
    for first in range(0, len(centres), per_slab):
        lower, upper = np.full(dim, -np.inf), np.full(dim, np.inf)
        lower[0] = centres[first]
        upper[0] = centres[first + per_slab] if first + per_slab < len(centres) else np.inf
        yield lattice.points_in(lower, upper)


def family_size(dim, ratio):
    """Return the number of lattice points within `ratio` spacings of one of them."""
    reach = int(ratio)
    axes = np.meshgrid(*[np.arange(-reach, reach + 1)] * dim, indexing="ij")
    return int((sum(axis.astype(float) ** 2 for axis in axes) <= ratio**2).sum()) - 1


def _family_step(scene, body):
    """Return the critical step of whole lattice families in the stiffest, lightest block, each body with its spacing and volume of a particle."""
    model, steps = scene.material[0].model, []
    for kind, spacing, volume in set(zip(kinds_by_body(scene), [lattice.spacing for lattice in body.lattices], body.volumes)):
        ratio = reach_of(kind[1]) / spacing
        sub, _ = block(scene.dim, 4 * int(ratio) + 3, ratio, scene.particles.kinematics == "linear", "cloud", model)
        particles, scale, number = sub.particles, spacing / 1e-3, body.blocks[body.kinds.index(kind), True]
        particles.reference *= scale
        sub.bonds.arrays.inv_length[:] /= scale
        particles.volume[:] = volume
        particles.block[:] = number
        sub.points.row_block[:] = number
        sub.make_state(body.law)
        steps.append(stable_step(sub, body.law))
    return min(steps)


def kernel_rate(scene, ratio, path, law, varied=False):
    """Return bonds per second and core of the force kernels of a law, measured on a small block; varied : whether the particles' volumes differ."""
    cells = {2: 60, 3: 16}[scene.dim]
    variant = variant_of(law, scene.particles.surface_correction)
    sub, law = block(scene.dim, cells, min(ratio, 4.0), scene.particles.kinematics == "linear", path, scene.material[0].model, variant)
    sub.particles.place()
    if varied:
        sub.points.row_block[:] = VARIED
    internal = InternalForces(sub, law, NoGhosts)
    best = math.inf
    for _ in range(4):
        started = time.perf_counter()
        internal.evaluate()
        best = min(best, time.perf_counter() - started)
    return sub.bonds.n_directed / best


def critical_stretches(scene, body):
    """Return [(material, value and formula)], a row for each horizon that a material has."""
    rows = []
    for number, setting in body.kinds:
        material = body.materials[number]
        if material.failure == "energy":
            rows.append((material.name, f"where w = {critical_pair_energy(setting, material.energy_release_rate):.6g} J/m^6 = {PAIR_ENERGY_FORMULA[scene.dimension]}"))
            continue
        limit = material.stretch_limit(setting)
        scatter = "" if material.weibull_modulus is None else f", the mean of a Weibull distribution of modulus {material.weibull_modulus:g}"
        if material.critical_stretch is not None:
            rows.append((material.name, f"{limit:.6g} (given){scatter}"))
        elif math.isinf(limit):
            rows.append((material.name, "none: bonds never break"))
        else:
            rows.append((material.name, f"{limit:.6g} = {material.formula[scene.dimension]}, influence {scene.particles.influence}{scatter}"))
    return rows
