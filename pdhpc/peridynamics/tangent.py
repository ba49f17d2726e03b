"""The stiffness of a subdomain's bonds as they are: what it does to a field, and its diagonal blocks. No bond breaks."""
from copy import copy
from dataclasses import replace

import numpy as np

from pdhpc.kernels import tangent as loops
from pdhpc.kernels.lattice import LatticeArrays
from pdhpc.materials.failure import StretchLimit
from pdhpc.peridynamics.internal_forces import InternalForces

_STRAIN = 3e-4


def unbreakable(subdomain, law):
    """Return (Subdomain, law) of the same particles and bonds, whose sweeps break none, whatever limits the law has. Local."""
    arrays, other = subdomain.bonds.arrays, copy(subdomain)
    if isinstance(arrays, LatticeArrays):
        arrays = arrays._replace(trigger=np.full_like(arrays.trigger, np.inf))
    other.bonds = replace(subdomain.bonds, arrays=arrays)
    other.points = subdomain.points._replace(raised=np.empty(0))
    return other, law._replace(break_at=np.full_like(law.break_at, np.inf), failure=StretchLimit())


def stiffness_blocks(subdomain, law, bounded=False):
    """Return (n_owned, dim, dim) N/m^5: see kernels/tangent.py. Local."""
    particles = subdomain.particles
    blocks = np.empty((particles.n_owned, particles.dim, particles.dim))
    loops.stiffness_blocks(
        subdomain.bonds.arrays, subdomain.points, law, subdomain.state, particles.third, particles.slots, bounded, blocks
    )
    return blocks


class Tangent:
    """J w, the derivative of the internal force density along a field w, at the present positions, from the sweeps of every step.

    Linear kinematics: the forces of the field itself. Finite kinematics: (f(x + h w) - f(x - h w))/(2 h), with h w at most _STRAIN spacings long. Its error is
    that in strain squared, and rounding over strain: below 1e-6 both, which neither Krylov methods (that are asked for 1e-4) nor Newton's feel; where Newton
    arrives depends on the forces alone. Costs two fields of the particles, three in finite kinematics, and two numbers a particle of state-based laws.

    Attributes
    ----------
    change : (n_owned, dim), N/m^3.
    """

    def __init__(self, subdomain, law, bind, sums, spacing):
        """subdomain, law : as of `unbreakable`. bind : function field -> what refreshes its ghosts. sums : Sums. spacing : m, of the particles."""
        self._particles, self._sums, self._spacing = subdomain.particles, sums, spacing
        other, particles = copy(subdomain), copy(subdomain.particles)
        particles.position, particles.force_density = np.zeros_like(particles.position), np.zeros_like(particles.force_density)
        other.particles, other.state = particles, None if subdomain.state is None else subdomain.state.copy(order="K")
        other.points = subdomain.points._replace(position=particles.position)
        self._shadow, self._forces = particles, InternalForces(other, law, bind)
        self.change = np.zeros((particles.n_owned, particles.dim))

    def apply(self, field, seconds):
        """Set `change` of a field (n_owned, dim), m. Collective, over neighbours only in linear kinematics.

        seconds : dict whose "force", "exchange" and "wait" grow.
        """
        self._forces.seconds = seconds
        if self._particles.linear:
            self._evaluate(field)
            self.change[...] = self._shadow.owned(self._shadow.force_density)
            return
        size = self._sums.largest(float(np.abs(field).max(initial=0.0)))
        step = _STRAIN * self._spacing / size if size > 0.0 else 1.0
        here = self._particles.owned(self._particles.position)[:, : self._particles.dim]
        self._evaluate(here + step * field)
        self.change[...] = self._shadow.owned(self._shadow.force_density)
        self._evaluate(here - step * field)
        self.change -= self._shadow.owned(self._shadow.force_density)
        self.change *= 0.5 / step

    def _evaluate(self, position):
        """Evaluate forces at positions (n_owned, dim), displacements in linear kinematics. Collective over neighbours."""
        self._shadow.position[self._shadow.slots, : self._shadow.dim] = position
        self._forces.evaluate()
