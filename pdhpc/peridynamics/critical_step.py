"""Critical time step of explicit integration, bounded from the assembled bonds."""
import math

from pdhpc.kernels.sweeps import largest_frequency2


def stable_step(subdomain, law, shared=True):
    """Return a step, s, at which central differences are stable on this rank's particles (the body's is the minimum over ranks). Local.

    A bond's energy obeys k ((u_i - u_j).e)^2 / 2 <= k (u_i.e)^2 + k (u_j.e)^2, hence K <= 2 diag(V_i A_i) with A_i = sum_j C weight V_j e (x) e (weight and C,
    the law's stiffness, of materials/law.py), and omega_max^2 <= 2 max_i |A_i|/rho_i: dt_c = 2/omega_max >= sqrt(2 min_i rho_i/|A_i|). The bound holds for any
    mix of materials, outlines and cracks, and is larger than the one-dimensional estimate sqrt(2 rho / sum_j c V_j/|xi|) of Silling & Askari (2005) by about
    the square root of the dimension. State-based laws bound the energy of dilatation by that of the bonds: exact at the Poisson's ratio of central forces,
    pessimistic above it. shared : count particles with shares of bonds too.
    """
    particles = subdomain.particles
    groups = [group for part in (0, 1) for group in subdomain.groups(part)[: None if shared else 1]]
    largest = max(largest_frequency2(bonds, subdomain.points, law, subdomain.state, particles.third, rows) for bonds, rows in groups)
    return math.sqrt(2.0 / largest) if largest > 0 else math.inf
