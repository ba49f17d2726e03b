"""Passes over the particles of a body that is brought to rest: what is out of balance, the motion that relaxes it, and sums that steer it.

`held` (n, dim) bool marks components whose displacement is prescribed; fields by slot, others (n, dim) by owned particle.
"""
from pdhpc.jit import kernel


@kernel
def square_forces(force_density, loads, held, volume, slots, squares):
    """Store squares of forces, N^2, in squares (3, n): of what is out of balance, of loads, and of what holds prescribed components.

    force_density (n_slots, dim) : total; loads (n, dim) : its part that is applied, N/m^3.
    """
    for n in range(len(slots)):
        i = slots[n]
        free, applied, reaction = 0.0, 0.0, 0.0
        for d in range(held.shape[1]):
            force = volume[i] * force_density[i, d]
            if held[n, d]:
                reaction += force * force
            else:
                free += force * force
                applied += (volume[i] * loads[n, d]) ** 2
        squares[0, n], squares[1, n], squares[2, n] = free, applied, reaction


@kernel
def rayleigh_parts(force_density, before, displacement, start, density, held, volume, slots, parts):
    """Store w . K w and w . D w, J and m^2 N/m, by particle in parts (2, n): K w from the change of forces, w that of displacements, since `start`.

    before, start (n, dim) : force densities and displacements then. density (n,) : fictitious one, N/m^4.
    """
    for n in range(len(slots)):
        i = slots[n]
        stiff, heavy = 0.0, 0.0
        for d in range(held.shape[1]):
            if not held[n, d]:
                w = displacement[i, d] - start[n, d]
                stiff += w * (before[n, d] - force_density[i, d])
                heavy += w * w
        parts[0, n], parts[1, n] = volume[i] * stiff, volume[i] * density[n] * heavy


@kernel
def relax(displacement, pace, force_density, density, held, slots, damping):
    """Take one step of D u'' + damping D u' = f of length 1 by central differences: v <- ((2 - c) v + 2 f/D)/(2 + c), u <- u + v.

    pace (n, dim) : v, m; density (n,) : D, N/m^4; a particle without one stays.
    """
    keep, push = (2.0 - damping) / (2.0 + damping), 2.0 / (2.0 + damping)
    for n in range(len(slots)):
        i = slots[n]
        if density[n] > 0.0:
            for d in range(held.shape[1]):
                if not held[n, d]:
                    pace[n, d] = keep * pace[n, d] + push / density[n] * force_density[i, d]
                    displacement[i, d] += pace[n, d]


@kernel
def add_work(force_density, loads, held, displacement, before, applied, volume, slots, work):
    """Store the work of loads and supports since the last equilibrium, J, in work (n,): V (P + P') . (u' - u)/2, P what acts on a particle beside its bonds.

    P is the load at free components and what balances the bonds at held ones. `before` and `applied`, (n, dim), hold u and P and take u' and P'.
    """
    for n in range(len(slots)):
        i = slots[n]
        total = 0.0
        for d in range(held.shape[1]):
            now = loads[n, d] - (force_density[i, d] if held[n, d] else 0.0)
            total += 0.5 * (applied[n, d] + now) * (displacement[i, d] - before[n, d])
            applied[n, d], before[n, d] = now, displacement[i, d]
        work[n] = volume[i] * total


@kernel
def add_loads(force_density, loads, slots):
    """Add loads (n, dim), N/m^3, of owned particles to force_density (n_slots, dim)."""
    for n in range(len(slots)):
        for d in range(loads.shape[1]):
            force_density[slots[n], d] += loads[n, d]
