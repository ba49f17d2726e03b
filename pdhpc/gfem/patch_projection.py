"""The patch around a vertex: mean and norm of the functions phi_i (eta - mean_i), and what of eta the standard functions of the patch cannot say."""
import numpy as np

from pdhpc.jit import kernel

_SMALLEST_PIVOT = 1e-12  # relative to the diagonal: functions that the points of a patch cannot tell apart are left out


@kernel
def set_means(stars, pair, masses, moments, mean):
    """Store mean_i = sum m phi_i eta / sum m phi_i of stars.vertex in mean (n_vertices, dim). Local.

    stars : Stars. pair : of moments.pairs. masses, moments : rows of mass_moments and field_moments for all cells of the stars.
    """
    count = masses.shape[1]
    for i in range(len(stars.vertex)):
        for d in range(mean.shape[1]):
            base = d * (1 + 2 * count)
            total, weight = 0.0, 0.0
            for k in range(stars.start[i], stars.start[i + 1]):
                c = stars.cell[k]
                for b in range(len(pair)):
                    q = pair[stars.corner[k], b]
                    total += moments[c, base + 1 + q] + moments[c, base] * masses[c, q]
                    weight += masses[c, q]
            mean[stars.vertex[i], d] = total / weight


@kernel
def set_norms(stars, pair, masses, moments, mean, norm):
    """Store norm_i = (sum m (phi_i (eta - mean_i))^2)^(1/2) of stars.vertex in norm (n_vertices, dim). Local. The others as in set_means."""
    count = masses.shape[1]
    for i in range(len(stars.vertex)):
        v = stars.vertex[i]
        for d in range(mean.shape[1]):
            base = d * (1 + 2 * count)
            square = 0.0
            for k in range(stars.start[i], stars.start[i + 1]):
                c, q = stars.cell[k], pair[stars.corner[k], stars.corner[k]]
                shift = moments[c, base] - mean[v, d]
                square += moments[c, base + 1 + count + q] + shift * (2.0 * moments[c, base + 1 + q] + shift * masses[c, q])
            norm[v, d] = np.sqrt(max(square, 0.0))


class PatchProjection:
    """The mass-weighted L2 projection onto the standard functions of the patches around some owned vertices, factorised once."""

    def __init__(self, stars, pair, masses, rows):
        """stars, pair, masses : as in set_means. rows (n,) int64, of stars: the patches. Local."""
        size = np.diff(stars.first)[rows]
        self._stars, self._pair, self._masses, self._rows = stars, pair, masses, rows
        self._start = np.concatenate(([0], np.cumsum(size**2))).astype(np.int64)
        self._factors = np.zeros(self._start[-1])
        self._work = np.empty(int(size.max(initial=0)))
        _factorise(stars, pair, masses, rows, self._start, self._factors)

    def residuals(self, moments, mean):
        """Return (n, dim): ||eta_c - P_i eta_c|| on each patch by the root of its mass. Local.

        moments : of field_moments, at all cells of the stars. mean (n_vertices, dim), of set_means.
        """
        residual = np.empty((len(self._rows), mean.shape[1]))
        _residuals(self._stars, self._pair, self._masses, self._rows, self._start, self._factors, moments, mean, self._work, residual)
        return residual


@kernel
def _factorise(stars, pair, masses, rows, start, factors):
    """Store L D L^T = sum_p m N N^T of each patch: 1/D on the diagonal, 0 for a pivot that is too small, and L below it."""
    corners = pair.shape[0]
    for n in range(len(rows)):
        i = rows[n]
        size = stars.first[i + 1] - stars.first[i]
        L = factors[start[n] : start[n + 1]].reshape(size, size)
        for k in range(stars.start[i], stars.start[i + 1]):
            for a in range(corners):
                for b in range(corners):
                    L[stars.slot[k, a], stars.slot[k, b]] += masses[stars.cell[k], pair[a, b]]
        for r in range(size):
            diagonal = L[r, r]
            for q in range(r):
                entry = L[r, q]
                for s in range(q):
                    entry -= L[r, s] * L[q, s]  # L[r, s] still holds L D, see below
                L[r, q] = entry
            pivot = diagonal
            for q in range(r):
                scaled = L[r, q] * L[q, q]
                pivot -= scaled * L[r, q]
                L[r, q] = scaled
            L[r, r] = 1.0 / pivot if pivot > _SMALLEST_PIVOT * diagonal else 0.0


@kernel
def _residuals(stars, pair, masses, rows, start, factors, moments, mean, z, residual):
    """|eta|^2 - z^T D^-1 z, L z = sum m N eta, with eta relative to mean_i."""
    corners, count = pair.shape[0], masses.shape[1]
    for n in range(len(rows)):
        i = rows[n]
        size = stars.first[i + 1] - stars.first[i]
        L = factors[start[n] : start[n + 1]].reshape(size, size)
        for d in range(mean.shape[1]):
            base = d * (1 + 2 * count)
            z[:size] = 0.0
            square, patch_mass = 0.0, 0.0
            for k in range(stars.start[i], stars.start[i + 1]):
                c = stars.cell[k]
                shift = moments[c, base] - mean[stars.vertex[i], d]
                for a in range(corners):
                    for b in range(corners):
                        q = pair[a, b]
                        first = moments[c, base + 1 + q] + shift * masses[c, q]
                        z[stars.slot[k, a]] += first
                        square += moments[c, base + 1 + count + q] + shift * (moments[c, base + 1 + q] + first)
                        patch_mass += masses[c, q]
            for r in range(size):
                for q in range(r):
                    z[r] -= L[r, q] * z[q]
                z[r] *= 1.0 if L[r, r] > 0.0 else 0.0
                square -= z[r] ** 2 * L[r, r]
            residual[n, d] = np.sqrt(max(square, 0.0) / patch_mass)
