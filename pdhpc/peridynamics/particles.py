"""The particles of one rank: owned first, in ascending global id, then ghosts by (owner, id)."""
from dataclasses import dataclass, field

import numpy as np

from pdhpc.kernels.motion import place


@dataclass
class Particles:
    """State and constants of owned and ghost particles.

    Attributes
    ----------
    id : (n_owned + n_ghost,) int64, global ids
    reference : (n_owned + n_ghost, dim), m, positions in the unloaded body, a view of padded_reference (n_owned + n_ghost, width)
    position : (n_owned + n_ghost, width), m, current positions (finite kinematics) or displacements (linear); width 2 in 2D, 4 in 3D
    volume : (n_owned + n_ghost,), m^3
    block : (n_owned + n_ghost,) uint8, index of material and failure rule
    displacement, velocity, force_density : (n_owned, dim), m, m/s, N/m^3 (total: bonds and loads)
    dissipated : (n_owned,), J, energy released by bonds that broke, half of each at either end
    """

    id: np.ndarray
    reference: np.ndarray
    volume: np.ndarray
    block: np.ndarray
    n_owned: int
    linear: bool
    padded_reference: np.ndarray = field(init=False)
    position: np.ndarray = field(init=False)
    displacement: np.ndarray = field(init=False)
    velocity: np.ndarray = field(init=False)
    force_density: np.ndarray = field(init=False)
    dissipated: np.ndarray = field(init=False)

    def __post_init__(self):
        n, dim = self.reference.shape
        self.padded_reference = np.zeros((n, 2 if dim == 2 else 4))
        self.padded_reference[:, :dim] = self.reference
        self.reference = self.padded_reference[:, :dim]
        self.position = np.zeros_like(self.padded_reference) if self.linear else self.padded_reference.copy()
        self.displacement = np.zeros((self.n_owned, dim))
        self.velocity = np.zeros((self.n_owned, dim))
        self.force_density = np.zeros((self.n_owned, dim))
        self.dissipated = np.zeros(self.n_owned)

    @property
    def dim(self):
        """2 or 3."""
        return self.reference.shape[1]

    @property
    def n_ghost(self):
        """Number of ghosts."""
        return len(self.id) - self.n_owned

    @property
    def owned(self):
        """Slice of the owned particles."""
        return slice(0, self.n_owned)

    @property
    def third(self):
        """The third axis as kernels take it: None in 2D, 2 in 3D."""
        return None if self.dim == 2 else 2

    def place(self):
        """Set the owned `position` from `displacement`."""
        place(self.reference, self.displacement, self.position, self.linear)

