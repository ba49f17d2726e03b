"""Energies that a multi-time-step integration conserves (Prakash & Hjelmstad 2004)."""


def inertia_of(stepper, field):
    """Return (n_owned,) 1/2 w' M w of a field (n_owned, dim), with this region's share of the masses. Local."""
    particles = stepper.subdomain.particles
    mass = stepper.law.density[particles.owned(particles.block)] * particles.owned(particles.volume)
    if particles.mass_share is not None:
        mass = mass * particles.mass_share[particles.slots]
    return 0.5 * mass * (field**2).sum(axis=1)


def conserved_energy(stepper, forces):
    """Return (n_owned,) 1/2 a'(M - dt^2/4 K) a + 1/2 v' K v, J/s^2, of one region in linear kinematics. Collective over neighbours.

    stepper : VelocityVerlet. forces : LinearForces of its subdomain.
    """
    particles = stepper.subdomain.particles
    velocity, acceleration = particles.owned(particles.velocity), stepper.acceleration()
    volume = particles.owned(particles.volume)
    share = 1.0 if particles.mass_share is None else particles.mass_share[particles.slots]
    rows = forces.all_rows()
    products = []
    for field in (acceleration, velocity):
        forces.w[particles.slots, : particles.dim] = field
        forces.apply(rows, rows)
        products.append(-0.5 * volume * share * (field * forces.force_density[particles.slots]).sum(axis=1))
    forces.w[particles.slots] = 0.0
    return inertia_of(stepper, acceleration) - stepper.dt**2 / 4 * products[0] + products[1]
