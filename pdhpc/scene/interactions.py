"""Scene -> contact and impactors, and what they do to the critical step."""
import math

import numpy as np

from pdhpc.conditions.impactors import CYLINDER, PLANE, SPHERE, Impactor
from pdhpc.kernels.contact import ContactLaw
from pdhpc.materials.bond_based import BondBased
from pdhpc.parallel.exact import ExactSums
from pdhpc.parallel.vicinity import Vicinity
from pdhpc.peridynamics.contact import Contact
from pdhpc.peridynamics.impact import Impact
from pdhpc.scene.conditions import time_function
from pdhpc.scene.loads import ConstantTime

_STIFFER = 15.0  # times the bonds' micromodulus: the repulsion of Parks et al. 2008
_WIDTHS = 1.35  # times the sum of two particles' radii: the distance of contact there
_SKIN = 0.3  # of a spacing: how much farther than that near pairs are listed
_TOUCHING = 2.0  # |sum n (x) n| over neighbours one spacing away: what the critical step allows for contact


def moduli_of(material):
    """Return (E, K), Pa, of a BondBased or a LinearSolid."""
    if isinstance(material, BondBased):
        return material.youngs_modulus, material.youngs_modulus / 1.5  # nu = 1/4
    bulk, shear = material.bulk_modulus, material.shear_modulus
    return 9 * bulk * shear / (3 * bulk + shear), bulk


def contact_modulus(scene, material):
    """Return c_s of a material against itself, N/m^6: given, or 15 times the micromodulus of bonds of constant influence."""
    if scene.contact.stiffness != "auto":
        return scene.contact.stiffness
    (young, bulk), delta = moduli_of(material), scene.particles.horizon
    if scene.dimension == "3d":
        return _STIFFER * 18 * bulk / (math.pi * delta**4)
    factor = 9 if scene.dimension == "plane_stress" else 48 / 5
    return _STIFFER * factor * young / (math.pi * scene.thickness * delta**3)


def contact_distance(scene):
    """Return the distance of contact of two particles of the lattice, m."""
    return _WIDTHS * scene.particles.spacing if scene.contact.distance == "auto" else scene.contact.distance


def penalty(scene, impactor, material):
    """Return s of an impactor against a material, N/m^4: given, or E/h^2."""
    return moduli_of(material)[0] / scene.particles.spacing**2 if impactor.stiffness == "auto" else impactor.stiffness


def stiffer_step(scene, body, critical):
    """Return the critical step, s, with what contact and impactors may add to |A|/rho of a particle of the lattice.

    From omega^2 <= 2 max (|A| + |A_c|)/rho (see peridynamics/critical_step.py) with |A_c| = 2 c_s V/horizon for pairs one spacing apart on both sides along
    every axis, and s for each impactor. Contact watches what is really pressed together, and says so where that is more.
    """
    if scene.contact is None and not scene.impactor:
        return critical
    added = 0.0
    for material in body.materials:
        stiffness = sum(penalty(scene, impactor, material) for impactor in scene.impactor)
        if scene.contact is not None:
            stiffness += _TOUCHING * contact_modulus(scene, material) * body.cell_volume / scene.particles.horizon
        added = max(added, stiffness / material.density)
    return math.sqrt(2.0 / (2.0 / critical**2 + added))


def make_interactions(scene, body, part, comm, dt):
    """Return [Contact and Impact] of this rank's particles, for steps dt, s. Local."""
    made = [] if scene.contact is None else [_make_contact(scene, body, part, comm, dt)]
    return made + [_make_impact(scene, body, part, comm, dt, table) for table in scene.impactor]


def _radius(scene, volume):
    """Return half the side of the cells of particles of some volume (n,), m^3, in m."""
    return 0.5 * (volume / scene.thickness) ** (1.0 / scene.dim)


def _of_blocks(body, function):
    """Return (n_block,) of what a function says of the material of each block."""
    values = np.empty(len(body.blocks))
    for (material, _), block in body.blocks.items():
        values[block] = function(body.materials[material])
    return values


def _make_contact(scene, body, part, comm, dt):
    modulus = _of_blocks(body, lambda material: contact_modulus(scene, material))
    pairs = np.where(modulus[:, None] == modulus[None, :], modulus[:, None], 2 * modulus[:, None] * modulus[None, :] / (modulus[:, None] + modulus[None, :]))
    law = ContactLaw(pairs / scene.particles.horizon, np.array(body.law.density, float), scene.contact.friction, scene.contact.damping, dt)

    def reach(volume):
        if scene.contact.distance == "auto":
            return _WIDTHS * _radius(scene, volume)
        return np.full(len(volume), 0.5 * scene.contact.distance)

    return Contact(part.subdomain, body.law, law, reach, Vicinity(comm), _SKIN * scene.particles.spacing)


def _make_impact(scene, body, part, comm, dt, table):
    particles = part.subdomain.particles
    volume, block = particles.owned(particles.volume), particles.owned(particles.block)
    stiffness = _of_blocks(body, lambda material: penalty(scene, table, material))[block]
    sums = None if table.mass is None else ExactSums(comm, scene.dim + 1)
    return Impact(part.subdomain, make_impactor(scene, table), (_radius(scene, volume), body.law.density[block] * volume, stiffness), table.friction, dt, sums)


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
