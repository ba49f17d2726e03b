"""Whether impactors start outside every body: one that starts inside would push with energy that nothing put in."""
import numpy as np

from pdhpc.geometry.points import PointBody
from pdhpc.parallel.comm import largest, smallest
from pdhpc.peridynamics.impact import depths
from pdhpc.scene.interactions import half_sizes, make_impactor
from pdhpc.scene.sections import section

_ROUNDING = 1e-6  # of a particle's size: as closely as boxes hold whole cells


def check_clear(scene, body, part, comm):
    """Raise a SceneError, on every rank, for an impactor that a particle enters at the start. Collective."""
    if not scene.impactor:
        return
    particles = part.subdomain.particles
    points = part.subdomain.places() + particles.owned(particles.displacement)[:, : scene.dim]
    half = half_sizes(scene, particles.owned(particles.volume))
    for number, table in enumerate(scene.impactor):
        depth = depths(make_impactor(scene, table), points, half)
        deepest = largest(comm, depth.max(initial=-np.inf))
        at = np.flatnonzero(depth == deepest)
        found = smallest(comm, particles.id[at].min(initial=np.iinfo(np.int64).max))
        size = 2 * largest(comm, half[at][particles.id[at] == found].max(initial=0.0))
        _refuse(scene, number, int(body.number_of(np.array([found]))[0]), deepest, size)


def check_clear_of(scene, number, lattice, ids, points):
    """Raise a SceneError for an impactor that some particles of the body `number` enter where they stand in the unloaded body. Local."""
    if isinstance(lattice, PointBody):
        half = half_sizes(scene, lattice.volume[lattice.rows_of(ids)])
    else:
        half = np.full(len(points), 0.5 * lattice.spacing)
    for place, table in enumerate(scene.impactor):
        depth = depths(make_impactor(scene, table), points, half)
        if len(depth):
            worst = int(np.argmax(depth))
            _refuse(scene, place, number, float(depth[worst]), 2 * half[worst])


def _refuse(scene, place, number, depth, size):
    """Raise a SceneError unless the particle of a `size`, m, that enters an impactor deepest does so within rounding; place, number : of impactor and body."""
    if not depth > _ROUNDING * size:
        return
    table = scene.impactor[place]
    key, at = ("point", table.point) if table.shape == "plane" else ("center", table.center)
    found = f"{list(at)}, from where the {table.shape} reaches into body '{scene.body[number].name}': {depth:.6g} m past the surface of a particle"
    allowed = f"a start outside every body, its surface at least {size / 2:.6g} m, half a particle's size, from the centre of every particle: at least {depth:.6g} m farther away"
    raise scene.error(f"{section('impactor', place, table)}: {key}", found, allowed)
