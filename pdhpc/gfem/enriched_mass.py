"""The mass matrix of the standard and the enriched functions: rows and columns fixed for given patches, values filled in for each field."""
import numpy as np

from pdhpc.jit import kernel


class EnrichedMass:
    """The rows of a rank's owned vertices: M = (rho psi_r, psi_s) over the points of enriched cells, plus a lumped mass of everything else.

    Unknowns of a rank, vertex by vertex and component by component: those of phi_i at each owned vertex of an enriched cell, then those of phi_i (eta - mean_i)
    at those in J. Each row is complete on its rank. An enriched function that is left out has a 1 on its diagonal and no other value.

    Attributes
    ----------
    standard, enriched : (n,) int32 each, local vertices whose functions are this rank's unknowns. n_local : number of unknowns, dim for each of these.
    first : their first global number.
    indptr, columns : int64, of the rows, columns in global numbers. values : (nnz,), kg for standard, without unit for enriched rows, filled by fill.
    """

    def __init__(self, mesh, cells, inside, dim, first_row):
        """Number the unknowns. Collective.

        mesh : fem.mesh.Mesh. cells : EnrichedCells. inside (n_vertices,) bool : J. first_row : function of a rank's number of unknowns -> its first number.
        """
        self._stars, self._corners, self.dim = cells.stars, cells.corners, dim
        stars = self._stars
        chosen = np.flatnonzero(inside[stars.vertex])
        self.standard, self.enriched = stars.vertex, stars.vertex[chosen]
        self.rows_in_stars = chosen
        self.n_local = dim * (len(stars.vertex) + len(chosen))
        numbers = np.full((len(mesh.points), 2), -1, np.int64)
        self.first = begin = first_row(self.n_local)
        numbers[stars.vertex, 0] = begin + dim * np.arange(len(stars.vertex))
        numbers[self.enriched, 1] = begin + dim * (len(stars.vertex) + np.arange(len(chosen)))
        bound = mesh.exchange.bind(numbers)
        bound.refresh()
        bound.free()
        self._lay_out(numbers, chosen)

    def _lay_out(self, numbers, chosen):
        """Set indptr and columns: in each row the standard neighbours, then the enriched ones, both as in the stars."""
        stars, dim = self._stars, self.dim
        star = np.repeat(np.arange(len(stars.vertex)), np.diff(stars.first))
        others = numbers[stars.neighbour, 1] >= 0
        width = np.diff(stars.first) + np.bincount(star[others], minlength=len(stars.vertex))
        begin = np.concatenate(([0], np.cumsum(width)))
        earlier = np.concatenate(([0], np.cumsum(others)))
        at_enriched = np.diff(stars.first)[star] + earlier[:-1] - earlier[stars.first[star]]
        self._place = np.where(others, at_enriched, -1).astype(np.int32)  # in its row, of the enriched function of each neighbour
        block = np.empty(begin[-1], np.int64)
        block[begin[star] + np.arange(len(star)) - stars.first[star]] = numbers[stars.neighbour, 0]
        block[(begin[star] + at_enriched)[others]] = numbers[stars.neighbour[others], 1]
        of_row = np.repeat(np.concatenate((np.arange(len(stars.vertex)), chosen)), dim)
        component = np.tile(np.arange(dim), len(of_row) // dim)
        self.indptr = np.concatenate(([0], np.cumsum(width[of_row])))
        within = np.arange(self.indptr[-1]) - np.repeat(self.indptr[:-1] - begin[of_row], width[of_row])
        self.columns = block[within] + np.repeat(component, width[of_row])
        self.values = np.zeros(self.indptr[-1])
        self._enriched_row = np.full(len(stars.vertex), -1, np.int64)
        self._enriched_row[chosen] = dim * (len(stars.vertex) + np.arange(len(chosen)))

    def fill(self, pair, masses, moments, lumped, mean, inverse_norm):
        """Set the values. Local.

        pair, masses, moments : as in patch_projection.set_means. lumped (n_vertices,), kg. mean, inverse_norm (n_vertices, dim), owned and ghosts; a
        function is left out where inverse_norm is 0.
        """
        layout = (self._corners, self._place, self._enriched_row, self.indptr)
        _fill(self._stars, layout, pair, masses, moments, lumped, mean, inverse_norm, self.values)


@kernel
def _fill(stars, layout, pair, masses, moments, lumped, mean, inverse_norm, values):
    """<phi_a, phi_b> = m0, <phi_a, psi_b> = (m1 + s_b m0) / n_b, <psi_a, psi_b> = (m2 + (s_a + s_b) m1 + s_a s_b m0) / (n_a n_b), s = r_c - mean."""
    corners, place, enriched_row, indptr = layout
    dim, count = mean.shape[1], masses.shape[1]
    values[:] = 0.0
    for i in range(len(stars.vertex)):
        v = stars.vertex[i]
        for d in range(dim):
            base = d * (1 + 2 * count)
            standard = indptr[dim * i + d]
            enriched = indptr[enriched_row[i] + d] if enriched_row[i] >= 0 else -1
            for k in range(stars.start[i], stars.start[i + 1]):
                c = stars.cell[k]
                shift = moments[c, base] - mean[v, d]
                for b in range(corners.shape[1]):
                    w, q, at = corners[c, b], pair[stars.corner[k], b], stars.slot[k, b]
                    m0, m1, m2 = masses[c, q], moments[c, base + 1 + q], moments[c, base + 1 + count + q]
                    other = moments[c, base] - mean[w, d]
                    values[standard + at] += m0
                    if enriched >= 0:
                        values[enriched + at] += (m1 + shift * m0) * inverse_norm[v, d]
                    at = place[stars.first[i] + at]
                    if at >= 0:
                        values[standard + at] += (m1 + other * m0) * inverse_norm[w, d]
                        if enriched >= 0:
                            values[enriched + at] += (m2 + (shift + other) * m1 + shift * other * m0) * (inverse_norm[v, d] * inverse_norm[w, d])
            k = stars.start[i]
            at = stars.slot[k, stars.corner[k]]
            values[standard + at] += lumped[v]
            if enriched >= 0 and inverse_norm[v, d] == 0.0:
                values[enriched + place[stars.first[i] + at]] = 1.0
