"""Surface correction: bonds near surfaces are made stiffer, so that particles there are as stiff as those within."""
import math

import numpy as np

from pdhpc.kernels import surface
from pdhpc.materials.law import of_pairs, settings_of

METHODS = ("energy", "volume")
REPEATS = 4
"""Times that the energy method is taken: once leaves a bar of four horizons 2.5 % too stiff, four times 1 %; tens of times the factors near surfaces drift apart."""


def correct_surfaces(subdomain, law, blocks, setting, bind, method):
    """Give the bonds of a cloud factors of their micromodulus, from the families as they are: before pre-cracks. Collective over neighbours.

    energy: a unit extension along each axis d stores W_i,d in particle i and W_d in the bulk; with s_d the mean of W_d/W_i,d of both ends and n the direction
    of the bond, lambda_ij = (sum_d (n_d/s_d)^2)^(-1/2) (Madenci & Oterkus 2014). Means of both ends leave W_i,d off at surfaces, so W_i,d is taken again with
    these factors, and the particles' own W_d/W_i,d multiply what they had, `REPEATS` times in all. volume: lambda_ij = 2 V0/(V_i + V_j), with V_i the volume of
    the family and V0 that in the bulk (Le & Bobaru 2018). Both are symmetric, so that momentum is conserved, and the same on any number of ranks.

    Parameters
    ----------
    blocks, setting : of the law, as BondBased.law takes them. bind : function field -> what refreshes its ghosts. method : of METHODS.
    """
    subdomain.correct_surfaces(np.ones(len(subdomain.bonds.arrays.neighbour)))
    if method == "energy":
        _correct_by_energy(subdomain, law, blocks, setting, bind)
    else:
        _correct_by_volume(subdomain, law, blocks, setting, bind)


def _correct_by_energy(subdomain, law, blocks, setting, bind):
    """Set the factors of method energy. Collective over neighbours."""
    arrays, points, particles = subdomain.bonds.arrays, subdomain.points, subdomain.particles
    own = of_pairs(blocks, setting, lambda material, between: material.micromodulus(between))
    bulk = bulk_energies(blocks, setting)[particles.owned(particles.block)][:, None]
    scale, energy = np.ones((2, particles.n_owned, particles.dim))
    field = np.ones((len(points.position), particles.dim))
    ghosts = bind(field)
    for _ in range(REPEATS):
        surface.directional_energies(arrays, points, law, own, particles.third, particles.slots, energy)
        with np.errstate(divide="ignore"):  # no bonds along an axis: infinite, and no bond asks
            scale *= bulk / energy
        particles.put(field, scale)
        ghosts.refresh()
        surface.energy_factors(arrays, points, particles.third, particles.slots, field, arrays.factor)


def _correct_by_volume(subdomain, law, blocks, setting, bind):
    """Set the factors of method volume. Collective over neighbours."""
    arrays, points, particles = subdomain.bonds.arrays, subdomain.points, subdomain.particles
    share, field = np.empty((particles.n_owned, 1)), np.ones((len(points.position), 1))
    surface.family_shares(arrays, points, law, of_pairs(blocks, setting, whole_family), particles.slots, share)
    particles.put(field, share)
    bind(field).refresh()
    surface.volume_factors(arrays, particles.slots, field, arrays.factor)


def bulk_energies(blocks, setting):
    """Return (n_block,), J/m^3: W = C_1111/2 = rho c_p^2/2 of a unit extension along an axis, by Hooke's law; c_p the speed of pressure waves."""
    return np.array([0.5 * material.density * material.wave_speed(each) ** 2 for (material, _), each in zip(blocks, settings_of(blocks, setting))])


def whole_family(material, setting):
    """Return the volume within the horizon of a Setting, m^3: 4 pi delta^3/3, or pi delta^2 t."""
    if setting.dimension == "3d":
        return 4 * math.pi * setting.horizon**3 / 3
    return math.pi * setting.horizon**2 * setting.thickness
