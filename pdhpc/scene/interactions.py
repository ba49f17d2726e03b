"""Scene -> contact and impactors, and what they do to the critical step."""
import math

import numpy as np

from pdhpc.conditions.impactors import CYLINDER, PLANE, SPHERE, Impactor
from pdhpc.geometry.points import PointBody
from pdhpc.kernels.contact import ContactLaw
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import of_pairs
from pdhpc.parallel.exact import ExactSums
from pdhpc.parallel.vicinity import Vicinity
from pdhpc.peridynamics.contact import Contact
from pdhpc.peridynamics.impact import Impact
from pdhpc.scene.body import kinds_by_body
from pdhpc.scene.conditions import time_function
from pdhpc.scene.loads import ConstantTime

_STIFFER = 15.0  # times the bonds' micromodulus: the repulsion of Parks et al. 2008
_WIDTHS = 1.35  # times the sum of two particles' radii: the distance of contact there
_SKIN = 0.3  # of the smallest spacing of all bodies: how much farther than that near pairs are listed
_TOUCHING = 2.0  # |sum n (x) n| over neighbours one spacing away: what the critical step allows for contact


def moduli_of(material):
    """Return (E, K), Pa, of a BondBased or a LinearSolid."""
    if isinstance(material, BondBased):
        return material.youngs_modulus, material.youngs_modulus / 1.5  # nu = 1/4
    bulk, shear = material.bulk_modulus, material.shear_modulus
    return 9 * bulk * shear / (3 * bulk + shear), bulk


def contact_modulus(scene, material, delta):
    """Return c_s of a material against itself at the horizon delta, m, N/m^6: given, or 15 times the micromodulus of bonds of constant influence."""
    if scene.contact.stiffness != "auto":
        return scene.contact.stiffness
    young, bulk = moduli_of(material)
    if scene.dimension == "3d":
        return _STIFFER * 18 * bulk / (math.pi * delta**4)
    factor = 9 if scene.dimension == "plane_stress" else 48 / 5
    return _STIFFER * factor * young / (math.pi * scene.thickness * delta**3)


def contact_stiffness(scene, body):
    """Return (n_block, n_block), N/m^7: c_s/horizon of pairs, at the mean horizon of both blocks, the harmonic mean of both materials' c_s there."""
    blocks, settings = body.calibration()
    own = of_pairs(blocks, settings, lambda material, between: contact_modulus(scene, material, between.horizon))
    horizon = of_pairs(blocks, settings, lambda material, between: between.horizon)
    return np.where(own == own.T, own, 2 * own * own.T / (own + own.T)) / horizon


def contact_distance(scene, size):
    """Return the distance of contact of two particles whose cells have the side `size`, m."""
    return _WIDTHS * size if scene.contact.distance == "auto" else scene.contact.distance


def penalty(impactor, material, size):
    """Return s of an impactor against particles of a material whose cells have the side `size`, m, N/m^4: given, or E/size^2."""
    return moduli_of(material)[0] / size**2 if impactor.stiffness == "auto" else impactor.stiffness


def sizes_of(lattice):
    """Return (smallest, largest) side of the cells of a body's particles, m."""
    return (lattice.sizes[0], lattice.sizes[2]) if isinstance(lattice, PointBody) else (lattice.spacing, lattice.spacing)


def stiffer_step(scene, body, critical):
    """Return the critical step, s, with what contact and impactors may add to |A|/rho of a particle.

    From omega^2 <= 2 max (|A| + |A_c|)/rho (see peridynamics/critical_step.py) with |A_c| = 2 c_s V/horizon for pairs one spacing apart on both sides along
    every axis, V the volume of the largest particle of either body, and s for each impactor. Contact watches what is really pressed together, and says so
    where that is more.
    """
    if scene.contact is None and not scene.impactor:
        return critical
    added, sizes = 0.0, [sizes_of(lattice) for lattice in body.lattices]
    kinds = kinds_by_body(scene)
    blocks, volumes = [body.blocks[body.kinds.index(kind), True] for kind in kinds], [largest**scene.dim * scene.thickness for _, largest in sizes]
    table = None if scene.contact is None else contact_stiffness(scene, body)
    for (number, _), block, (smallest, _) in zip(kinds, blocks, sizes):
        stiffness = sum(penalty(impactor, body.materials[number], smallest) for impactor in scene.impactor)
        if table is not None:
            stiffness += _TOUCHING * max(table[block, other] * volume for other, volume in zip(blocks, volumes))
        added = max(added, stiffness / body.materials[number].density)
    return math.sqrt(2.0 / (2.0 / critical**2 + added))


def make_interactions(scene, body, part, comm, dt):
    """Return [Contact and Impact] of this rank's particles, for steps dt, s. Local."""
    made = [] if scene.contact is None else [_make_contact(scene, body, part, comm, dt)]
    return made + [_make_impact(scene, body, part, comm, dt, table) for table in scene.impactor]


def half_sizes(scene, volume):
    """Return half the side of the cells of particles of some volume (n,), m^3, in m."""
    return 0.5 * (volume / scene.thickness) ** (1.0 / scene.dim)


def _make_contact(scene, body, part, comm, dt):
    law = ContactLaw(contact_stiffness(scene, body), np.array(body.law.density, float), scene.contact.friction, scene.contact.damping, dt)

    def reach(volume):
        if scene.contact.distance == "auto":
            return _WIDTHS * half_sizes(scene, volume)
        return np.full(len(volume), 0.5 * scene.contact.distance)

    return Contact(part.subdomain, body.law, law, reach, Vicinity(comm), _SKIN * body.spacing)


def _make_impact(scene, body, part, comm, dt, table):
    particles = part.subdomain.particles
    volume, block = particles.owned(particles.volume), particles.owned(particles.block)
    radius, blocks = half_sizes(scene, volume), body.calibration()[0]
    stiffness = np.empty(len(block))
    for number, (material, _) in enumerate(blocks):
        stiffness[block == number] = penalty(table, material, 2 * radius[block == number])
    sums = None if table.mass is None else ExactSums(comm, scene.dim + 1)
    return Impact(part.subdomain, make_impactor(scene, table), (radius, body.law.density[block] * volume, stiffness), table.friction, dt, sums)


def make_impactor(scene, table):
    """Return the Impactor of a table."""
    kind = {"sphere": SPHERE, "cylinder": CYLINDER, "plane": PLANE}[table.shape]
    axis = np.zeros(3)
    direction = table.normal if kind == PLANE else getattr(table, "axis", None)
    if direction is not None:
        axis[: scene.dim] = np.asarray(direction) / np.linalg.norm(direction)
    elif kind == CYLINDER:
        axis[2] = 1.0  # across the plane
    half_length = 0.5 * table.length if kind == CYLINDER and table.length is not None else math.inf
    shape = kind, axis, getattr(table, "radius", 0.0), half_length
    velocity = np.zeros(scene.dim) if table.velocity is None else table.velocity
    return Impactor(table.name, shape, table.place, velocity, time_function(table.time or ConstantTime()), math.inf if table.mass is None else table.mass, table.gravity)
