"""Compile the kernels of a run on a tiny body, so that one process per node fills the cache before the others read it."""
import numpy as np

from pdhpc.geometry.cracks import cut_bonds, disk, polyline
from pdhpc.geometry.faces import count_face
from pdhpc.geometry.lattice import LatticeBody
from pdhpc.geometry.shapes import Box
from pdhpc.kernels import motion
from pdhpc.kernels.bond_states import count_alive, foremost_damaged
from pdhpc.kernels.cloud import bond_forces
from pdhpc.kernels.neighbours import count_neighbours
from pdhpc.materials.bond_based import BondBased, Setting, make_law
from pdhpc.parallel.partition import Partition
from pdhpc.peridynamics.critical_step import stable_step
from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.peridynamics.subdomain import make_subdomain


def block(dim, cells, ratio, linear=False):
    """Return (Subdomain, Law) of a small cube of `cells` per side, family radius `ratio` spacings: for warming up and for measuring kernels. Local."""
    spacing = 1e-3
    body = LatticeBody(Box((0.0,) * dim, (cells * spacing,) * dim), spacing, 0)
    setting = Setting("3d" if dim == 3 else "plane_stress", ratio * spacing, 1.0, "constant")
    law = make_law([(BondBased("steel", 7800.0, 200e9, 1e4), True)], setting, spacing, "none")
    empty = Partition(np.empty(0, np.int64), np.empty(0), np.empty((0, 2), np.int64), 1)
    describe = lambda points, number: (np.full(len(points), spacing**dim), np.zeros(len(points), np.uint8))  # noqa: E731
    return make_subdomain([body], empty, 0, ratio * (1 + 1e-9) * spacing, describe, linear), law


def compile_kernels(dims=(2, 3)):
    """Call every kernel of a run once in each of the dimensions `dims`; kinematics and material share one compilation. Local."""
    for dim in dims:
        subdomain, law = block(dim, 4, 2.0)
        particles, arrays = subdomain.particles, subdomain.bonds.arrays
        count_neighbours(particles.reference, 1, 2e-3)
        crack = polyline([[-1.0, -1.0], [-1.0, -2.0]]) if dim == 2 else disk([-1.0] * 3, [1.0, 0, 0], 0.1)
        cut_bonds(arrays, particles.reference, particles.n_owned, crack)
        count_face(arrays.row_start, arrays.neighbour, particles.reference, np.ones(particles.n_owned, bool), 0, 1e-3)
        stable_step(subdomain.points, arrays, law)
        counts = np.empty(particles.n_owned, np.int32)
        count_alive(arrays, counts)
        foremost_damaged(arrays, counts, 0.5, np.arange(2), np.zeros(particles.n_owned))
        particles.place()
        bond_forces(subdomain.points, arrays, law, False, particles.third, (0, particles.n_owned), particles.force_density, particles.dissipated)
        motion.kick(particles.velocity, particles.force_density, 1.0 / law.density, particles.block, 0.0)
        motion.drift(particles.displacement, particles.velocity, particles.reference, particles.position, False, 0.0)
        motion.all_finite(particles.displacement)
        strain_energy_density(subdomain, law)
