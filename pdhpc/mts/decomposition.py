"""The ramp split: which particles a coarse and a fine region hold, and what share of mass, bonds and energy each has of the particles that both hold.

Fine are the particles in a shape; the overlap reaches a width beyond it and belongs to both; coarse is the rest. With the shares of both regions added up the
body is the undivided one, bond for bond (Aksoylu & Parks 2011 split likewise; the ramp, and masses that follow stiffness, keep the critical step of each
region within a few per cent of the undivided one's).
"""
from typing import NamedTuple

import numpy as np

from pdhpc.geometry.shapes import Beyond, Bonded, Within
from pdhpc.kernels import shared


class Split(NamedTuple):
    """How a body is split.

    shape : of geometry/shapes.py. width : of the overlap, m. spacing : h, m. radius : of the families, m.
    by_points : share the energy of each point (state-based laws), not of each bond. stencil : of the lattice that all bodies lie on, or None.
    """

    shape: object
    width: float
    spacing: float
    radius: float
    by_points: bool
    stencil: object = None

    @property
    def coarse(self):
        """The window of the coarse region: everything beyond the shape."""
        return Beyond(self.shape, 0.0)

    @property
    def fine(self):
        """The window of the fine region: the shape and the overlap, on a lattice of one family radius no more of it than bonds ask for."""
        if self.stencil is not None and self.width <= self.radius * (1 + 1e-6):
            return Bonded(self.shape, self.width, self.spacing, self.stencil)
        return Within(self.shape, self.width)

    def overlap(self, points):
        """Return (n,) bool: which points (n, dim), m, lie in the overlap."""
        return (self.shape.distance(points) > 0.0) & self.fine.contains(points)

    def coarse_share(self, points):
        """Return (n,) alpha, the coarse region's share of a point: 0 in the shape, 1 beyond the overlap, a ramp (d + h/2)/(w + h) over the distance d between.

        By points: 0 up to a family radius from the shape, and 1 up to a family radius from the other side: whoever has a share of a point's energy has its
        whole family.
        """
        distance = self.shape.distance(points)
        start, end = (self.radius, self.width - self.radius) if self.by_points else (0.0, self.width)
        ramp = (distance - start + 0.5 * self.spacing) / (end - start + self.spacing)
        beyond = distance > end if self.by_points else ~self.fine.contains(points)
        return np.where(distance <= start, 0.0, np.where(beyond, 1.0, ramp))


def shares_by_slot(subdomain, share):
    """Return (n_slots,) the region's share of each particle, ghosts too. Local. share : function points (n, dim) -> (n,), 0 to 1."""
    particles = subdomain.particles
    ramp = np.zeros(len(particles.position))
    slots = np.concatenate([particles.slots, particles.ghost_slots])
    ramp[slots] = share(subdomain.places_at(slots)) if len(slots) else 0.0
    return ramp


def share_bonds(subdomain, law, ramp, overlap):
    """Weigh the bonds of the particles in the slots `overlap` by the ramp, or share their energies by it (state-based laws). Local."""
    if subdomain.state is None:
        shared.share_by_ramp(subdomain.shared, ramp, overlap)
        return
    with np.errstate(divide="ignore"):
        shared.set_over_energies(subdomain.shared, overlap, np.where(ramp[overlap] > 0.0, 1.0 / ramp[overlap], 0.0))
    share_state(subdomain, ramp)


def share_state(subdomain, ramp):
    """Scale a_i of a state-based law by each owned particle's share of its own energy. Local."""
    if subdomain.state is not None:
        slots = subdomain.particles.slots
        subdomain.state[slots, 0] *= ramp[slots]


def stiffnesses(subdomain, law, overlap):
    """Return (n,) traces of the stiffness that this region's share of the bonds gives the particles in `overlap`, N/m^5. Local; ghosts' state must be fresh."""
    found = np.zeros(len(overlap))
    shared.stiffnesses(subdomain.shared, subdomain.points, law, subdomain.state, overlap, found)
    return found


_LEAST_MASS = 1e-6  # share of the mass of a copy that no bond of its region holds: it follows the other copy


def mass_share(own, other):
    """Return (n,) the share of the mass: in proportion to stiffness, own/(own + other), but at least 1e-6; half where nothing holds the particle."""
    total = own + other
    share = np.where(total > 0.0, own / np.where(total > 0.0, total, 1.0), 0.5)
    return np.clip(share, _LEAST_MASS, 1.0 - _LEAST_MASS)
