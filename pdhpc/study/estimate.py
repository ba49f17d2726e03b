"""What a scene would cost: counted and built where it is small, estimated from a sample where it is large."""
import math
import time
from typing import List, NamedTuple, Tuple

import numpy as np

from pdhpc.geometry.lattice import points_of_bodies
from pdhpc.kernels.cloud import bond_forces
from pdhpc.kernels.neighbours import LANES
from pdhpc.materials.bond_based import CRITICAL_STRETCH_FORMULA, Setting
from pdhpc.parallel.comm import world
from pdhpc.scene.build import build, choose_step, make_body, make_gauges, radius_of, select
from pdhpc.warm_up import block

_BYTES_PER_SLOT = 12.125  # neighbour, inverse length, bond state
_BYTES_PER_PARTICLE = {2: 114, 3: 170}
_SMALL = 1.2e7  # directed bonds up to which the body is built
_SLAB_POINTS = 1 << 20


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


def estimate(scene, ranks=None):
    """Return the Estimate of a scene. Raises SceneError as a run would. Local to one process."""
    comm = world()
    ranks = ranks or comm.size
    body = make_body(scene)
    ratio = radius_of(scene) / scene.particles.spacing
    family = _family_size(scene.dim, ratio)
    cells = sum(int(np.prod(lattice.cells, dtype=object)) for lattice in body.lattices)
    exact = cells * family <= _SMALL
    if exact:
        particles, bonds, neighbours, critical, warnings = _built(scene, ranks)
    else:
        particles, bonds, neighbours, critical, warnings = _sampled(scene, body, family, ratio)
    dt, steps, more = choose_step(scene, critical)
    rate = _kernel_rate(scene, ratio)
    slots = particles * math.ceil(neighbours / LANES) * LANES
    memory = (slots * _BYTES_PER_SLOT + particles * _BYTES_PER_PARTICLE[scene.dim]) / ranks
    seconds = 2 * bonds * steps / (rate * ranks)
    stretch = _critical_stretches(scene, body)
    return Estimate(exact, particles, bonds, neighbours, stretch, critical, dt, steps, ranks, memory, rate, seconds, warnings + more)


def _built(scene, ranks):
    """Build the body in this process and count."""
    from mpi4py import MPI

    problem = build(scene, MPI.COMM_SELF)
    make_gauges(problem, MPI.COMM_SELF)
    bonds = problem.subdomain.bonds
    warnings = [] if ranks <= problem.subdomain.particles.n_owned else [f"{ranks} ranks for {problem.subdomain.particles.n_owned} particles: some own nothing"]
    return problem.subdomain.particles.n_owned, bonds.n_directed // 2, int(bonds.family_size.max(initial=0)), problem.critical_dt, warnings


def _sampled(scene, body, family, ratio):
    """Count particles slab by slab, check that every region holds one, and take bonds and step from whole families."""
    names = {name for name in _region_names(scene) if name != "all"}
    particles = 0
    for lattice_number, lattice in enumerate(body.lattices):
        for points in _slabs(lattice):
            particles += len(points)
            numbers = np.full(len(points), lattice_number)
            names = {name for name in names if not select(scene, name, points, numbers).any()}
    if names:
        raise scene.error("region", f'"{sorted(names)[0]}", which selects no particle', "a region that holds at least one")
    return particles, particles * family // 2, family, _family_step(scene, body, ratio), []


def _region_names(scene):
    used = [each.region for group in (scene.load, scene.initial, scene.tip) for each in group]
    return used + [probe.region for probe in scene.probe if probe.region is not None] + list(scene.damage.no_fail)


def _slabs(lattice):
    """Yield the points of a lattice in pieces of bounded size."""
    centres = lattice.centres(0)
    layer = int(np.prod(lattice.cells[1:]))
    per_slab = max(1, _SLAB_POINTS // layer)
    dim = len(lattice.cells)
    for first in range(0, len(centres), per_slab):
        lower, upper = np.full(dim, -np.inf), np.full(dim, np.inf)
        lower[0] = centres[first]
        upper[0] = centres[first + per_slab] if first + per_slab < len(centres) else np.inf
        yield points_of_bodies([lattice], lower, upper)[1]


def _family_size(dim, ratio):
    """Return the number of lattice points within `ratio` spacings of one of them."""
    reach = int(ratio)
    axes = np.meshgrid(*[np.arange(-reach, reach + 1)] * dim, indexing="ij")
    return int((sum(axis.astype(float) ** 2 for axis in axes) <= ratio**2).sum()) - 1


def _family_step(scene, body, ratio):
    """Return the critical step of a whole lattice family in the stiffest, lightest block."""
    from pdhpc.peridynamics.critical_step import stable_step

    cells = 2 * int(ratio) + 1
    sub, _ = block(scene.dim, cells, ratio)
    scale = scene.particles.spacing / 1e-3
    particles = sub.particles
    particles.reference *= scale
    arrays = sub.bonds.arrays._replace(inv_length=sub.bonds.arrays.inv_length / scale)
    particles.volume[:] = body.cell_volume
    steps = []
    for number in range(len(body.law.density)):
        particles.block[:] = number
        sub.points.row_block[:] = number
        steps.append(stable_step(sub.points, arrays, body.law))
    return min(steps)


def _kernel_rate(scene, ratio):
    """Return bonds per second and core of the force kernel, measured on a small block."""
    cells = {2: 60, 3: 14}[scene.dim]
    sub, law = block(scene.dim, cells, min(ratio, 4.0), scene.particles.kinematics == "linear")
    particles = sub.particles
    particles.place()
    best = math.inf
    for _ in range(4):
        started = time.perf_counter()
        bond_forces(sub.points, sub.bonds.arrays, law, particles.linear, particles.third, (0, particles.n_owned), particles.force_density, particles.dissipated)
        best = min(best, time.perf_counter() - started)
    return sub.bonds.n_directed / best


def _critical_stretches(scene, body):
    """Return [(material, value and formula)]."""
    thickness = scene.thickness
    setting = Setting(scene.dimension, scene.particles.horizon, thickness, scene.particles.influence)
    rows = []
    for material in body.materials:
        limit = material.stretch_limit(setting)
        if material.critical_stretch is not None:
            rows.append((material.name, f"{limit:.6g} (given)"))
        elif math.isinf(limit):
            rows.append((material.name, "none: bonds never break"))
        else:
            rows.append((material.name, f"{limit:.6g} = {CRITICAL_STRETCH_FORMULA[scene.dimension]}, influence {scene.particles.influence}"))
    return rows
