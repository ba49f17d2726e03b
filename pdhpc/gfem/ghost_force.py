"""Ghost forces: what a blend of particles and elements does to a body under uniform strain, where the sum of all forces on every vertex should vanish."""
import numpy as np

from pdhpc.gfem import lanes
from pdhpc.kernels import blend
from pdhpc.kernels.lattice import WORD
from pdhpc.kernels.simd import LANES


def ghost_force(local, solution, strain=(1.0, 1.0, 0.0)):
    """Return max_i |(F^alpha + r(d), phi_i)| / (sigma H t) over this rank's vertices, for the displacement of a strain in Voigt's notation, 2D.

    Collective over neighbours.

    sigma : the largest stress that it causes inside the body. Vertices nearer to the body's surface than two cells are left out: there the forces are those of
    the surface; broken bonds count as whole. A blend by a step in the place of the ramp gives five to ten times as much.
    """
    mesh, blended, domain = solution.mesh, local.blended, local.subdomain
    gradient = np.array([[strain[0], 0.5 * strain[2]], [0.5 * strain[2], strain[1]]])
    particles = domain.particles
    position = np.zeros(particles.position.shape[::-1]).T
    slots = np.concatenate([local.cell_slots.ravel(), local.collar.slots, particles.ghost_slots])
    position[slots] = domain.places_at(slots) @ gradient.T
    force, impulse = np.zeros(particles.position.shape[::-1]).T, np.zeros_like(blended.impulse)
    law = local.law._replace(break_at=np.full_like(local.law.break_at, np.inf))
    bonds = _whole(domain.bonds.arrays)
    points = domain.points._replace(position=position)
    weights, moment = np.array([1.0, 0.0]), np.zeros_like(impulse)
    blend.blended_forces(bonds, points, law, particles.third, blended.rows, local.alpha, local.alpha, force, particles.dissipated, weights, impulse, moment)
    kept = solution.displacement.copy()
    solution.displacement[:] = mesh.points @ gradient.T
    solution.evaluate_elements()
    solution.right[:] = solution.force
    solution.displacement[:] = kept
    outside = np.zeros(LANES * len(blended.rows), bool)
    lanes.project_velocity(blended.rows, blended.cell, blended.number, blended.table, blended.alpha, outside, blended.velocity_before, impulse, position,
                           blended.density, local.volume, mesh.cells, solution.right)
    solution.gather_right()
    inner = _inner(mesh)[: mesh.n_owned]
    moduli = solution.material.moduli
    stress = np.abs(moduli @ np.asarray(strain)).max(initial=0.0)
    scale = stress * mesh.cell_size[0] * local.volume / local.lattice.spacing**2
    found = np.abs(solution.right[: mesh.n_owned][inner]).max(initial=0.0)
    return float(found / scale) if scale > 0.0 else 0.0


def _whole(arrays):
    """Return the bonds of a lattice that fills all of space and never breaks. Local."""
    count = len(arrays.offset)
    words = np.array([2 ** min(WORD, count - WORD * word) - 1 for word in range(len(arrays.alive))], np.uint64)
    return arrays._replace(trigger=np.full_like(arrays.trigger, np.inf), alive=np.repeat(words[:, None], arrays.alive.shape[1], axis=1))


def _inner(mesh):
    """Return (n_vertices,) bool: vertices all of whose cells, and the cells around these, exist. Collective over neighbours."""
    counts = np.zeros((len(mesh.points), 1))
    owned = mesh.cells[: mesh.n_owned_cells]
    np.add.at(counts[:, 0], owned.ravel(), 1.0)
    shared = mesh.exchange.bind(counts)
    shared.accumulate()
    shared.refresh()
    surface = counts[:, 0] < 2**mesh.dim
    counts[:, 0] = 0.0
    np.add.at(counts[:, 0], owned[surface[owned].any(axis=1)].ravel(), 1.0)
    shared.accumulate()
    shared.free()
    return ~surface & (counts[:, 0] == 0.0)
