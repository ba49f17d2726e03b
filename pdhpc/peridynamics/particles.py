"""The particles of one rank, named by slots: rows of their arrays. Two layouts with one face: a cloud, and the cells of a lattice.

Both have, beside the attributes below: slots (n_owned,) int32, of owned particles in ascending global id; ghost_slots (n_ghost,) int32, by (owner, id);
id (n_owned + n_ghost,) int64, global ids in this order; n_owned, n_ghost; dim; linear, True or None (finite kinematics), as kernels take it; and by slot

    position (n_slots, width), m, current positions (finite kinematics) or displacements (linear)
    displacement, velocity, force_density (n_slots, dim), m, m/s, N/m^3 (total: bonds and loads)
    dissipated (n_slots,), J, energy released by bonds that broke, half of each at either end
    volume (n_slots,), m^3; block (n_slots,) uint8, index of material and failure rule
"""
from dataclasses import dataclass, field

import numpy as np

from pdhpc.kernels import motion
from pdhpc.state import Entry


class _Slotted:
    """What both layouts share.

    mass_share : None, or (n_slots,) of each particle's mass that is here, where a body is shared between several problems.
    """

    mass_share = None

    @property
    def n_ghost(self):
        """Number of ghosts."""
        return len(self.id) - self.n_owned

    @property
    def third(self):
        """The third axis as kernels take it: None in 2D, 2 in 3D."""
        return None if self.dim == 2 else 2

    def owned(self, values):
        """Return the rows of a field by slot that belong to owned particles, in ascending id: a copy, or a view where they lie together."""
        return values[: self.n_owned] if self.contiguous else values[self.slots]

    def put(self, field, values):
        """Store values (n_owned, ...) of owned particles, in ascending id, in a field by slot."""
        field[self.slots] = values

    def ids_at(self, slots):
        """Return (n,) int64, the global ids of owned particles by slot."""
        by_slot = np.full(len(self.position), -1, np.int64)
        by_slot[self.slots] = self.id[: self.n_owned]
        return by_slot[slots]

    def entry(self, field):
        """Return the Entry of a field by slot: its owned rows."""
        return Entry(lambda: self.owned(field), lambda values: self.put(field, values), self.id[: self.n_owned])


@dataclass
class Particles(_Slotted):
    """A cloud: owned particles in the first slots, then ghosts. Arrays by slot of velocities, forces and dissipation hold the owned ones only.

    reference : (n_owned + n_ghost, dim), m, positions in the unloaded body, a view of padded_reference (n_owned + n_ghost, width), width 2 or 4.
    """

    id: np.ndarray
    reference: np.ndarray
    volume: np.ndarray
    block: np.ndarray
    n_owned: int
    linear: bool
    contiguous = True
    padded_reference: np.ndarray = field(init=False)
    position: np.ndarray = field(init=False)
    displacement: np.ndarray = field(init=False)
    velocity: np.ndarray = field(init=False)
    force_density: np.ndarray = field(init=False)
    dissipated: np.ndarray = field(init=False)

    def __post_init__(self):
        self.linear = True if self.linear else None
        n, dim = self.reference.shape
        self.padded_reference = np.zeros((n, 2 if dim == 2 else 4))
        self.padded_reference[:, :dim] = self.reference
        self.reference = self.padded_reference[:, :dim]
        self.position = np.zeros_like(self.padded_reference) if self.linear else self.padded_reference.copy()
        self.displacement = np.zeros((self.n_owned, dim))
        self.velocity = np.zeros((self.n_owned, dim))
        self.force_density = np.zeros((self.n_owned, dim))
        self.dissipated = np.zeros(self.n_owned)
        self.slots = np.arange(self.n_owned, dtype=np.int32)
        self.ghost_slots = np.arange(self.n_owned, n, dtype=np.int32)

    @property
    def dim(self):
        """2 or 3."""
        return self.reference.shape[1]

    def place(self):
        """Set the owned `position` from `displacement`."""
        motion.place(self.reference, self.displacement, self.position, self.linear)

    def kick(self, inverse_density, dt):
        """v += dt f / rho; inverse_density (256,), m^3/kg, by block."""
        motion.kick(self.velocity, self.force_density, inverse_density, self.block, dt)

    def drift(self, dt):
        """u += dt v, and `place`."""
        motion.drift(self.displacement, self.velocity, self.reference, self.position, self.linear, dt)

    def kick_drift(self, inverse_density, half, dt):
        """`kick` by `half`, `drift` by dt, s, in one pass."""
        motion.kick_drift(
            self.velocity, self.force_density, inverse_density, self.block, self.displacement, self.reference, self.position, self.linear, half, dt
        )


class LatticeParticles(_Slotted):
    """Particles on the cells of a padded grid: slots are cells, each component of a field lies together, (n_slots, dim) is a view of (dim, n_slots).

    Memory per slot in 3D: position, displacement, velocity, force density 96 bytes, dissipation 8, block 1; per particle: id 8, slot 4.
    """

    contiguous = False

    def __init__(self, ids, slots, ghost_slots, block, cell_volume, rows, dim, linear):
        """block : (n_slots,) uint8, MIXED where no particle is. rows : motion.Rows, the cells that this rank owns."""
        n_slots = len(block)
        self.id, self.slots, self.ghost_slots, self.block = ids, slots, ghost_slots, block
        self.n_owned, self.dim, self.linear, self.rows = len(slots), dim, True if linear else None, rows
        self.volume = np.broadcast_to(np.array(cell_volume), (n_slots,))
        self._position, self._displacement, self._velocity, self._force = (np.zeros((dim, n_slots)) for _ in range(4))
        self.position, self.displacement, self.velocity, self.force_density = self._position.T, self._displacement.T, self._velocity.T, self._force.T
        self.dissipated = np.zeros(n_slots)

    def place(self):
        """Set the owned `position` from `displacement`."""
        motion.place_rows(self.rows, self._displacement, self._position, self.linear)

    def kick(self, inverse_density, dt):
        """v += dt f / rho; inverse_density (256,), m^3/kg, by block."""
        motion.kick_rows(self.rows, self._velocity, self._force, inverse_density, self.block, dt)

    def drift(self, dt):
        """u += dt v, and `place`."""
        motion.drift_rows(self.rows, self._displacement, self._velocity, self._position, self.linear, dt)

    def kick_drift(self, inverse_density, half, dt):
        """`kick` by `half`, `drift` by dt, s, in one pass."""
        motion.kick_drift_rows(
            self.rows, self._velocity, self._force, inverse_density, self.block, self._displacement, self._position, self.linear, half, dt
        )
