"""The material as the mesh sees it when particles take part: stiffnesses from the lattice's own bonds, so that elements and particles agree.

    K_e(alpha) = sum_p V (1 - alpha_p) B_p^T C_p B_p,   C_p = 1/2 sum_q c omega beta V |xi| (e e)(e e),

at the particles of each cell (nodal quadrature). C_p counts the bonds that a particle has at the start of the run, before pre-cracks: within a horizon of an edge it is
softer, as the particles are. Cells of equal bonds share one K_e.
"""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.blend import lattice_moduli

_PIECE = 1 << 16  # cells looked at together: bounds the temporary memory


class LatticeMaterial:
    """Stiffnesses and masses of the owned cells of a mesh.

    Attributes
    ----------
    kind : (n_owned_cells,) int32, of each cell. moduli : (n_kinds, ratio^dim, s, s), Pa, of each kind's particles, 0 where there is none.
    stiffness : (n_kinds, corners dim, corners dim), N/m. lumped : (n_kinds, corners), kg, row sums of the mass matrix. consistent : (n_kinds, corners, corners).
    """

    def __init__(self, lattice, subdomain, law):
        """lattice : CellLattice. Before cracks are cut. Local."""
        self._lattice, self._subdomain, self._law = lattice, subdomain, law
        mesh = lattice.mesh
        keys = self._keys()
        found, first, kind = np.unique(keys, return_index=True, return_inverse=True)
        self.kind = kind.astype(np.int32).ravel()
        self._slots = lattice.slots_of(first.astype(np.int32))
        particles = subdomain.particles
        size = 3 if mesh.dim == 2 else 6
        self.moduli = np.zeros((len(found), len(lattice.template), size, size))
        self._mass = np.zeros((len(found), len(lattice.template)))
        for number in range(len(found)):  # kinds, not cells
            there = self._slots[number] >= 0
            slots = self._slots[number][there]
            values = np.empty((len(slots), size, size))
            lattice_moduli(subdomain.bonds.arrays, subdomain.points, law, particles.third, slots, values)
            self.moduli[number, there] = values
            self._mass[number, there] = law.density[particles.block[slots]] * particles.volume[slots]
        self.volume = float(particles.volume[0]) if len(particles.volume) else 0.0
        self.lumped = self._mass @ lattice.shape
        self.consistent = np.einsum("np,pa,pb->nab", self._mass, lattice.shape, lattice.shape)
        self.stiffness = np.zeros((len(found), self.degrees, self.degrees))
        everything = np.ones((len(found), len(lattice.template)))
        cell_stiffness(lattice.gradient, self.moduli, np.arange(len(found), dtype=np.int32), everything, self.volume, self.stiffness)

    @property
    def degrees(self):
        """Degrees of freedom of a cell."""
        return self._lattice.shape.shape[1] * self._lattice.mesh.dim

    def _keys(self):
        """Return (n_owned_cells,) uint64 that are equal for cells whose particles have equal blocks and bonds."""
        n_cells, arrays = self._lattice.mesh.n_owned_cells, self._subdomain.bonds.arrays
        factors = np.random.default_rng(20260101).integers(1, 2**63, (len(arrays.alive) + 1, len(self._lattice.template)), dtype=np.uint64) | np.uint64(1)
        keys = np.zeros(n_cells, np.uint64)
        for first in range(0, n_cells, _PIECE):
            cells = np.arange(first, min(first + _PIECE, n_cells), dtype=np.int32)
            _mix(self._lattice.slots_of(cells), arrays.alive, self._subdomain.particles.block, factors, keys[first : first + len(cells)])
        return keys

    def ramped(self, cells, outside):
        """Return (n, d, d) stiffnesses of owned cells with the weights `outside` (n, ratio^dim) = 1 - alpha at their particles."""
        result = np.zeros((len(cells), self.degrees, self.degrees))
        cell_stiffness(self._lattice.gradient, self.moduli, self.kind[cells], outside, self.volume, result)
        return result


@kernel
def _mix(slots, alive, block, factors, keys):
    """Store a key of each cell: a sum over its particles, whose terms mix block and bond states by a place-dependent factor."""
    words = len(alive)
    for c in range(len(slots)):
        key = np.uint64(0)
        for p in range(slots.shape[1]):
            i = slots[c, p]
            if i >= 0:
                for w in range(words):
                    mixed = (alive[w, i] + np.uint64(0x9E3779B97F4A7C15)) * factors[w, p]
                    key += (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
                mixed = (np.uint64(block[i]) + np.uint64(1)) * factors[words, p]
                key += (mixed ^ (mixed >> np.uint64(31))) * np.uint64(0x94D049BB133111EB)
        keys[c] = key


@kernel
def cell_stiffness(gradient, moduli, kind, weight, volume, result):
    """Store sum_p V w_p B_p^T C_p B_p in result (n, corners dim, corners dim).

    gradient (n_points, corners, dim), 1/m; moduli (n_kinds, n_points, s, s), Pa; kind (n,); weight (n, n_points); volume, m^3.
    """
    corners, dim = gradient.shape[1], gradient.shape[2]
    size = 3 if dim == 2 else 6
    for c in range(len(kind)):
        for p in range(len(gradient)):
            if weight[c, p] == 0.0:
                continue
            b = np.zeros((size, corners * dim))
            for a in range(corners):
                if dim == 2:
                    x, y = gradient[p, a, 0], gradient[p, a, 1]
                    b[0, 2 * a], b[1, 2 * a + 1], b[2, 2 * a], b[2, 2 * a + 1] = x, y, y, x
                else:
                    x, y, z = gradient[p, a, 0], gradient[p, a, 1], gradient[p, a, 2]
                    b[0, 3 * a], b[1, 3 * a + 1], b[2, 3 * a + 2] = x, y, z
                    b[3, 3 * a + 1], b[3, 3 * a + 2], b[4, 3 * a], b[4, 3 * a + 2], b[5, 3 * a], b[5, 3 * a + 1] = z, y, z, x, y, x
            factor = volume * weight[c, p]
            c_p = moduli[kind[c], p]
            for m in range(corners * dim):
                for s in range(size):
                    stress = 0.0
                    for t in range(size):
                        stress += c_p[s, t] * b[t, m]
                    for n in range(corners * dim):
                        result[c, m, n] += factor * stress * b[s, n]


@kernel
def add_cell_forces(cells, chosen, stiffness, displacement, force):
    """force -= K_e d_e of cells chosen (n,), stiffness (n, d, d) or through `kind`; displacement, force (n_vertices, dim)."""
    corners, dim = cells.shape[1], displacement.shape[1]
    local = np.empty(corners * dim)
    for n in range(len(chosen)):
        corner, k = cells[chosen[n]], stiffness[n]
        for a in range(corners):
            for d in range(dim):
                local[a * dim + d] = displacement[corner[a], d]
        for m in range(corners * dim):
            total = 0.0
            for j in range(corners * dim):
                total += k[m, j] * local[j]
            force[corner[m // dim], m % dim] -= total


@kernel
def add_kind_forces(cells, chosen, kind, stiffness, displacement, force):
    """force -= K d of cells chosen (n,) whose stiffness is stiffness[kind[cell]]; see add_cell_forces."""
    corners, dim = cells.shape[1], displacement.shape[1]
    local = np.empty(corners * dim)
    for n in range(len(chosen)):
        corner, k = cells[chosen[n]], stiffness[kind[chosen[n]]]
        for a in range(corners):
            for d in range(dim):
                local[a * dim + d] = displacement[corner[a], d]
        for m in range(corners * dim):
            total = 0.0
            for j in range(corners * dim):
                total += k[m, j] * local[j]
            force[corner[m // dim], m % dim] -= total


@kernel
def cell_energies(cells, chosen, stiffness, displacement, energy):
    """Store d_e . K_e d_e / 2, J, of cells chosen (n,) with stiffness (n, d, d) in energy (n,)."""
    corners, dim = cells.shape[1], displacement.shape[1]
    for n in range(len(chosen)):
        corner, k, total = cells[chosen[n]], stiffness[n], 0.0
        for m in range(corners * dim):
            for j in range(corners * dim):
                total += displacement[corner[m // dim], m % dim] * k[m, j] * displacement[corner[j // dim], j % dim]
        energy[n] = 0.5 * total
