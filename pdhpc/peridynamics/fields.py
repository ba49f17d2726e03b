"""Fields of the owned particles that output and probes ask for by name."""
import numpy as np

from pdhpc.kernels import sweeps


def field(name, subdomain, law):
    """Return the field `name` of the owned particles; see FIELDS for names, shapes and units. Local (ghost positions must be fresh)."""
    return FIELDS[name](subdomain, law)


def _displacement(subdomain, law):
    return subdomain.particles.owned(subdomain.particles.displacement)


def _velocity(subdomain, law):
    return subdomain.particles.owned(subdomain.particles.velocity)


def _force_density(subdomain, law):
    return subdomain.particles.owned(subdomain.particles.force_density)


def _damage(subdomain, law):
    return subdomain.bonds.damage()


def _precrack(subdomain, law):
    return subdomain.bonds.precrack()


def _active(subdomain, law):
    return np.ones(subdomain.particles.n_owned)


def strain_energy_density(subdomain, law):
    """Return (n_owned,) J/m^3, stored in intact bonds."""
    energy = np.zeros(len(subdomain.particles.dissipated))
    particles = subdomain.particles
    for bonds, rows in subdomain.groups(0) + subdomain.groups(1):
        sweeps.strain_energy_density(bonds, subdomain.points, law, subdomain.state, particles.linear, particles.third, rows, energy)
    return subdomain.particles.owned(energy)


def _sets(subdomain):
    """Return [(bonds, owned indices)] that together are all owned particles: the marked ones with their shares of bonds."""
    everyone = np.arange(subdomain.particles.n_owned)
    marked = subdomain.marked()
    return [(subdomain.bonds.arrays, everyone if not marked.any() else everyone[~marked])] + ([(subdomain.shared, everyone[marked])] if marked.any() else [])


def _stress(subdomain, law):
    particles = subdomain.particles
    result = np.empty((particles.n_owned, particles.dim, particles.dim))
    for bonds, members in _sets(subdomain):
        part = np.empty((len(members),) + result.shape[1:])
        sweeps.stress(bonds, subdomain.points, law, subdomain.state, particles.linear, particles.third, particles.slots[members], part)
        result[members] = part
    return result


def _strain(subdomain, law):
    return strain_of(subdomain, *deformation_moments(subdomain, law))


def deformation_moments(subdomain, law):
    """Return (K, N), (n_owned, dim, dim) both, of sweeps.deformation_moments; those of both copies of a shared particle add up."""
    particles = subdomain.particles
    shape = np.empty((particles.n_owned, particles.dim, particles.dim))
    moment = np.empty_like(shape)
    for bonds, members in _sets(subdomain):
        parts = np.empty((2, len(members)) + shape.shape[1:])
        sweeps.deformation_moments(bonds, subdomain.points, law, particles.third, particles.slots[members], parts[0], parts[1])
        shape[members], moment[members] = parts
    return shape, moment


def strain_of(subdomain, shape, moment):
    """Return (n, dim, dim): Green-Lagrange strain (F^T F - I)/2 (finite) or (H + H^T)/2 (linear), H = F - I = sum w eta (x) xi V K^-1.

    A direction in which a particle has no intact bonds has no strain.
    """
    linear = subdomain.particles.linear
    if not linear:
        moment = moment - shape
    gradient = moment @ _inverses(shape)
    strain = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    if not linear:
        strain += 0.5 * np.swapaxes(gradient, 1, 2) @ gradient
    return strain


def _inverses(tensors):
    """Return inverses of symmetric (n, d, d) tensors, pseudo-inverses where they are singular."""
    dim = tensors.shape[1]
    size = np.trace(tensors, axis1=1, axis2=2) / dim
    regular = np.linalg.det(tensors) > 1e-9 * size**dim
    inverses = np.empty_like(tensors)
    inverses[regular] = np.linalg.inv(tensors[regular])
    singular = np.flatnonzero(~regular)
    if singular.size:
        inverses[singular] = np.linalg.pinv(tensors[singular], rcond=1e-6, hermitian=True)
    return inverses


FIELDS = {
    "displacement": _displacement,
    "velocity": _velocity,
    "damage": _damage,
    "precrack": _precrack,
    "force_density": _force_density,
    "stress": _stress,
    "strain": _strain,
    "strain_energy_density": strain_energy_density,
    "active": _active,
}
"""Name -> function(subdomain, law): vectors (n_owned, dim) in m, m/s, N/m^3; damage, precrack, active (n_owned,); tensors (n_owned, dim, dim), stress in Pa.

active : 1 where particles move by themselves, as all do that nothing else moves."""
