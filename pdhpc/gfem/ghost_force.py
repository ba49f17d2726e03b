"""Ghost forces: what a blend of particles and elements does to a body under uniform strain, where the sum of all forces on every vertex should vanish."""
import numpy as np

from pdhpc.gfem import lanes
from pdhpc.kernels import blend
from pdhpc.kernels.lattice import WORD
from pdhpc.kernels.simd import LANES
from pdhpc.parallel.comm import largest


def ghost_force(local, solution, strain=(1.0, 1.0, 0.0)):
    """Return max_i |(F^alpha + r(d), phi_i)| / (sigma H t) over this rank's vertices, for the displacement of a strain in Voigt's notation, 2D.

    Collective.

    sigma : the largest stress that it causes inside the body. Vertices nearer than two cells to the body's surface or to another material are left out: there
    the forces are those of the surface, or of the jump of the stress; broken bonds count as whole. A blend by a step in the place of the ramp gives five to ten times as much.
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
    blend.blended_forces(bonds, points, law, particles.third, blended.rows, local.alpha, local.alpha, force, particles.dissipated, weights, impulse, moment,
                         np.empty_like(blended.seen))
    kept = solution.displacement.copy()
    solution.displacement[:] = mesh.points @ gradient.T
    solution.evaluate_elements()
    solution.right[:] = solution.force
    solution.displacement[:] = kept
    outside = np.zeros(LANES * len(blended.rows), bool)
    lanes.project_velocity(blended.rows, blended.cell, blended.number, blended.table, blended.alpha, outside, blended.velocity_before, impulse, position,
                           blended.density, local.volume, mesh.cells, np.ones(len(mesh.points), bool), solution.right)
    solution.gather_right()
    material = solution.material
    inner = _inner(mesh, np.trace(material.moduli.mean(axis=1), axis1=1, axis2=2)[material.kind[: mesh.n_owned_cells]])[: mesh.n_owned]
    stress = largest(mesh.comm, float(np.abs(material.moduli @ np.asarray(strain)).max(initial=0.0)))
    scale = stress * mesh.cell_size[0] * local.volume / local.lattice.spacing**2
    found = np.abs(solution.right[: mesh.n_owned][inner]).max(initial=0.0)
    return float(found / scale) if scale > 0.0 else 0.0


def _whole(arrays):
    """Return the bonds of a lattice that fills all of space and never breaks. Local."""
    count = len(arrays.offset)
    words = np.array([2 ** min(WORD, count - WORD * word) - 1 for word in range(len(arrays.alive))], np.uint64)
    return arrays._replace(trigger=np.full_like(arrays.trigger, np.inf), alive=np.repeat(words[:, None], arrays.alive.shape[1], axis=1))


def _inner(mesh, stiffness):
    """Return (n_vertices,) bool: vertices all of whose cells, and the cells around these, exist and are as stiff. Collective over neighbours.

    stiffness : (n_owned_cells,), Pa.
    """
    counts = np.zeros((len(mesh.points), 3))  # cells, sum and sum of squares of their stiffness
    owned = mesh.cells[: mesh.n_owned_cells]
    for column in range(3):
        np.add.at(counts[:, column], owned.ravel(), np.repeat(stiffness**column, owned.shape[1]))
    shared = mesh.exchange.bind(counts)
    shared.accumulate()
    shared.refresh()
    number, total, squares = counts.T
    surface = (number < 2**mesh.dim) | (number * squares - total**2 > 1e-8 * total**2)
    counts[:, 0] = 0.0
    np.add.at(counts[:, 0], owned[surface[owned].any(axis=1)].ravel(), 1.0)
    shared.accumulate()
    shared.free()
    return ~surface & (counts[:, 0] == 0.0)
