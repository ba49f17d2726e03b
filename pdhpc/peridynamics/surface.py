"""Surface correction: bonds near surfaces are made stiffer, so that particles there are as stiff as those within."""
import math

import numpy as np

from pdhpc.kernels import surface
from pdhpc.materials.law import of_pairs, settings_of

METHODS = ("energy", "volume")


def correct_surfaces(subdomain, law, blocks, setting, bind, method):
    """Give the bonds of a cloud factors of their micromodulus, from the families as they are: before pre-cracks. Collective over neighbours.

    energy: a unit extension along each axis d stores W_i,d in particle i and W_d in the bulk; with s_d the mean of W_d/W_i,d of both ends and n the direction
    of the bond, lambda_ij = (sum_d (n_d/s_d)^2)^(-1/2) (Madenci & Oterkus 2014). volume: lambda_ij = 2 V0/(V_i + V_j), with V_i the volume of the family and
    V0 that in the bulk (Le & Bobaru 2018). Both are symmetric, so that momentum is conserved, and the same on any number of ranks.

    Parameters
    ----------
    blocks, setting : of the law, as BondBased.law takes them. bind : function field -> what refreshes its ghosts. method : of METHODS.
    """
    arrays, points, particles = subdomain.bonds.arrays, subdomain.points, subdomain.particles
    columns = particles.dim if method == "energy" else 1
    mine = np.empty((particles.n_owned, columns))
    if method == "energy":
        own = of_pairs(blocks, setting, lambda material, between: material.micromodulus(between))
        surface.directional_energies(arrays, points, law, own, particles.third, particles.slots, mine)
        with np.errstate(divide="ignore"):  # no bonds along an axis: infinite, and no bond asks
            mine = bulk_energies(blocks, setting)[particles.owned(particles.block)][:, None] / mine
    else:
        surface.family_shares(arrays, points, law, of_pairs(blocks, setting, whole_family), particles.slots, mine)
    field = np.ones((len(points.position), columns))
    particles.put(field, mine)
    bind(field).refresh()
    factor = np.ones(len(arrays.neighbour))
    if method == "energy":
        surface.energy_factors(arrays, points, particles.third, particles.slots, field, factor)
    else:
        surface.volume_factors(arrays, particles.slots, field, factor)
    subdomain.correct_surfaces(factor)


def bulk_energies(blocks, setting):
    """Return (n_block,), J/m^3: W = C_1111/2 = rho c_p^2/2 of a unit extension along an axis, by Hooke's law; c_p the speed of pressure waves."""
    return np.array([0.5 * material.density * material.wave_speed(each) ** 2 for (material, _), each in zip(blocks, settings_of(blocks, setting))])


def whole_family(material, setting):
    """Return the volume within the horizon of a Setting, m^3: 4 pi delta^3/3, or pi delta^2 t."""
    if setting.dimension == "3d":
        return 4 * math.pi * setting.horizon**3 / 3
    return math.pi * setting.horizon**2 * setting.thickness
