"""The material as the mesh sees it when particles take part: stiffnesses from the lattice's own bonds, so that elements and particles agree.

    K_e(alpha) = sum_p V (1 - alpha_p) B_p^T C_p B_p,   C_p = 1/2 sum_q c omega beta V |xi| (e e)(e e),

at the particles of each cell (nodal quadrature). C_p counts the bonds that a particle has at the start of the run, before pre-cracks: within a horizon of an
edge it is softer, as the particles are. Cells of equal bonds, between equal materials, share one K_e.
"""
from functools import cached_property

import numpy as np

from pdhpc.jit import inlined, kernel, sweep
from pdhpc.kernels.blend import lattice_moduli
from pdhpc.kernels.family import MIXED, is_alive
from pdhpc.kernels.simd import fma, load8, splat, store8

_PIECE = 1 << 16  # cells looked at together: bounds the temporary memory


class LatticeMaterial:
    """Stiffnesses and masses of the owned cells of a mesh.

    Attributes
    ----------
    kind : (n_owned_cells,) int32, of each cell. moduli : (n_kinds, ratio^dim, s, s), Pa, of each kind's particles, 0 where there is none.
    stiffness : (n_kinds 2^corners, corners dim, corners dim), N/m: of kind k with alpha the interpolation of 0 and 1 at the corners, entry 2^corners k + sum of
    2^a over the corners where it is 1. lumped : (n_kinds, corners), kg, row sums of the mass matrix. consistent : (n_kinds, corners, corners).
    """

    def __init__(self, lattice, subdomain, law, continuum=None):
        """lattice : CellLattice. Before cracks are cut. continuum : None, or (n_block, s, s), Pa, moduli by block in the place of the lattice's. Local."""
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
            self.moduli[number, there] = values if continuum is None else continuum[particles.block[slots]]
            self._mass[number, there] = law.density[particles.block[slots]] * particles.volume[slots]
        self.volume = float(particles.volume[0]) if len(particles.volume) else 0.0
        self.lumped = self._mass @ lattice.shape
        self.consistent = np.einsum("np,pa,pb->nab", self._mass, lattice.shape, lattice.shape)

    @cached_property
    def whole_stiffness(self):
        """(n_kinds, corners dim, corners dim), N/m: of elements that particles replace nowhere."""
        result, count = np.zeros((len(self.moduli), self.degrees, self.degrees)), len(self.moduli)
        cell_stiffness(self._lattice.gradient, self.moduli, np.arange(count, dtype=np.int32), np.ones((count, len(self._lattice.shape))), self.volume, result)
        return result

    @cached_property
    def stiffness(self):
        """K(alpha) = K - sum of K_a over corners where alpha is 1, K_a with the weight N_a; see the class."""
        shape, count = self._lattice.shape, len(self.moduli)
        corners = shape.shape[1]
        parts = np.zeros((corners, count, self.degrees, self.degrees))
        for a in range(corners):
            weight = np.broadcast_to(shape[:, a], (count, len(shape)))
            cell_stiffness(self._lattice.gradient, self.moduli, np.arange(count, dtype=np.int32), weight, self.volume, parts[a])
        outside = 1.0 - (np.arange(2**corners)[:, None] >> np.arange(corners) & 1)
        table = np.einsum("ra,akmn->krmn", outside, parts)
        return np.ascontiguousarray(table.reshape(count * 2**corners, self.degrees, self.degrees))

    def ramped_kind(self, weight):
        """Return (n_owned_cells,) int32: the entry of `stiffness` of each cell, and whether its elements act at all, (n_owned_cells,) bool.

        weight : (n_vertices,), 0 or 1, the nodal values of alpha. Local.
        """
        mesh = self._lattice.mesh
        whole = weight[mesh.cells[: mesh.n_owned_cells]] > 0.0
        corners = whole.shape[1]
        return (self.kind * 2**corners + whole @ (1 << np.arange(corners))).astype(np.int32), ~whole.all(axis=1)

    @property
    def degrees(self):
        """Degrees of freedom of a cell."""
        return self._lattice.shape.shape[1] * self._lattice.mesh.dim

    def _keys(self):
        """Return (n_owned_cells,) uint64 that are equal for cells whose particles have equal blocks, bonds and blocks at the bonds' other ends."""
        n_cells, arrays = self._lattice.mesh.n_owned_cells, self._subdomain.bonds.arrays
        shape = (len(arrays.alive) + 1 + len(arrays.offset), len(self._lattice.template))
        factors = np.random.default_rng(20260101).integers(1, 2**63, shape, dtype=np.uint64) | np.uint64(1)
        keys = np.zeros(n_cells, np.uint64)
        for first in range(0, n_cells, _PIECE):
            cells = np.arange(first, min(first + _PIECE, n_cells), dtype=np.int32)
            _mix(self._lattice.slots_of(cells), arrays, self._subdomain.particles.block, factors, keys[first : first + len(cells)])
        return keys


@kernel
def _mix(slots, bonds, block, factors, keys):
    """Store a key of each cell: a sum over its particles, whose terms mix by place-dependent factors block, bond states, and other blocks at intact bonds."""
    words = len(bonds.alive)
    for c in range(len(slots)):
        key = np.uint64(0)
        for p in range(slots.shape[1]):
            i = slots[c, p]
            if i >= 0:
                for w in range(words):
                    key += _scrambled(bonds.alive[w, i], factors[w, p])
                key += _scrambled(np.uint64(block[i]), factors[words, p])
                if bonds.kind[i >> 3] == MIXED:
                    for k in range(len(bonds.offset)):
                        j = i + bonds.offset[k]
                        if is_alive(bonds, i, k) and block[j] != block[i]:
                            key += _scrambled(np.uint64(block[j]), factors[words + 1 + k, p])
        keys[c] = key


@inlined
def _scrambled(value, factor):
    """Return a uint64 in which every bit depends on those of value."""
    mixed = (value + np.uint64(0x9E3779B97F4A7C15)) * factor
    return (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)


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


@sweep
def add_kind_forces(cells, chosen, kind, stiffness, displacement, force, buffer):
    """force -= K_e d_e of quads chosen (n,) whose stiffness is stiffness[kind[cell]]; displacement, force (n_vertices, 2); buffer (8,).

    The eight forces of a cell go together: K_e is symmetric, so that its columns are rows.
    """
    for n in range(len(chosen)):
        corner, first = cells[chosen[n]], 64 * np.int64(kind[chosen[n]])
        total = splat(0.0)
        for a in range(4):
            total = fma(load8(stiffness, first + 16 * a), splat(displacement[corner[a], 0]), total)
            total = fma(load8(stiffness, first + 16 * a + 8), splat(displacement[corner[a], 1]), total)
        store8(buffer, 0, total)
        for a in range(4):
            force[corner[a], 0] -= buffer[2 * a]
            force[corner[a], 1] -= buffer[2 * a + 1]


@kernel
def kind_energies(cells, chosen, kind, stiffness, displacement, energy):
    """Store d_e . K_e d_e / 2, J, of cells chosen (n,) whose stiffness is stiffness[kind[cell]] in energy (n,)."""
    corners, dim = cells.shape[1], displacement.shape[1]
    for n in range(len(chosen)):
        corner, k, total = cells[chosen[n]], stiffness[kind[chosen[n]]], 0.0
        for m in range(corners * dim):
            for j in range(corners * dim):
                total += displacement[corner[m // dim], m % dim] * k[m, j] * displacement[corner[j // dim], j % dim]
        energy[n] = 0.5 * total
