"""Updates of velocities and positions, one pass over the owned particles each, no temporaries."""
from pdhpc.jit import kernel


@kernel
def place(reference, displacement, position, linear):
    """Store X + u (finite) or u (linear), m, of owned particles in position (n, width)."""
    for i in range(len(displacement)):
        for d in range(displacement.shape[1]):
            position[i, d] = displacement[i, d] if linear else reference[i, d] + displacement[i, d]


@kernel
def kick(velocity, force_density, inverse_density, block, dt):
    """v += dt f / rho; velocity, force_density (n_owned, dim); inverse_density (n_block,), m^3/kg."""
    for i in range(len(velocity)):
        factor = dt * inverse_density[block[i]]
        for d in range(velocity.shape[1]):
            velocity[i, d] += factor * force_density[i, d]


@kernel
def drift(displacement, velocity, reference, position, linear, dt):
    """u += dt v; position = X + u (finite) or u (linear)."""
    for i in range(len(displacement)):
        for d in range(displacement.shape[1]):
            displacement[i, d] += dt * velocity[i, d]
            position[i, d] = displacement[i, d] if linear else reference[i, d] + displacement[i, d]


@kernel
def all_finite(field):
    """Return the index of the first row of field (n, width) with a NaN or an infinity, or -1."""
    for i in range(len(field)):
        total = 0.0
        for d in range(field.shape[1]):
            total += field[i, d] * 0.0
        if total != 0.0:
            return i
    return -1
