"""Integrals over the points of enriched cells: masses and moments of a field against products of two functions of the mesh, and tested momentum.

A field is taken relative to its mean r_c in each cell, so that what is nearly constant loses no digits. Products N_a N_b of a cell's k functions are stored for
a <= b, P = k (k + 1) / 2 of them, in the order of the upper triangle's rows; `pairs` gives the place of (a, b).
"""
import numpy as np

from pdhpc.jit import kernel


def pairs(corners):
    """Return (corners, corners) int64, the places of products N_a N_b. Local."""
    place = np.zeros((corners, corners), np.int64)
    upper = np.triu_indices(corners)
    place[upper] = place.T[upper] = np.arange(len(upper[0]))
    return place


def width_of_field(corners, dim):
    """Return the number of values per cell that field_moments stores: for each component r_c, then P first, then P second moments. Local."""
    return dim * (1 + corners * (corners + 1))


@kernel
def mass_moments(start, shape, mass, moments):
    """Store m0 = sum_p m N_a N_b, kg, in rows of moments (n_cells or more, P). Local.

    start (n_cells + 1,), the points of each cell. shape (n, k). mass (n,), kg.
    """
    corners = shape.shape[1]
    for c in range(len(start) - 1):
        moments[c] = 0.0
        for p in range(start[c], start[c + 1]):
            q = 0
            for a in range(corners):
                weight = mass[p] * shape[p, a]
                for b in range(a, corners):
                    moments[c, q] += weight * shape[p, b]
                    q += 1


@kernel
def field_moments(start, shape, mass, eta, moments):
    """Store for each component r_c = sum_p m eta / sum_p m, m1 = sum_p m N_a N_b (eta - r_c) and m2 = sum_p m N_a N_b (eta - r_c)^2. Local.

    start, shape, mass as in mass_moments. eta (n, dim). moments (n_cells or more, width_of_field).
    """
    corners = shape.shape[1]
    count = corners * (corners + 1) // 2
    for c in range(len(start) - 1):
        for d in range(eta.shape[1]):
            base = d * (1 + 2 * count)
            total, sum_of_masses = 0.0, 0.0
            for p in range(start[c], start[c + 1]):
                total += mass[p] * eta[p, d]
                sum_of_masses += mass[p]
            reference = total / sum_of_masses
            moments[c, base] = reference
            first, second = moments[c, base + 1 : base + 1 + count], moments[c, base + 1 + count : base + 1 + 2 * count]
            first[:] = 0.0
            second[:] = 0.0
            for p in range(start[c], start[c + 1]):
                e = eta[p, d] - reference
                q = 0
                for a in range(corners):
                    weight = mass[p] * shape[p, a]
                    for b in range(a, corners):
                        product = weight * shape[p, b] * e
                        first[q] += product
                        second[q] += product * e
                        q += 1


@kernel
def cell_masses(pair, masses):
    """Return (n_cells,), kg, the mass of each cell: sum_ab m0, since the functions' sum is 1. Local."""
    total = np.zeros(len(masses))
    for c in range(len(masses)):
        for a in range(len(pair)):
            for b in range(len(pair)):
                total[c] += masses[c, pair[a, b]]
    return total


@kernel
def squares(cell_mass, pair, moments):
    """Return (n_cells,), sum_p m |eta|^2 of each cell; moments (n_cells, width_of_field). Local."""
    total, count = np.zeros(len(moments)), len(pair) * (len(pair) + 1) // 2
    for c in range(len(moments)):
        for base in range(0, moments.shape[1], 1 + 2 * count):
            total[c] += cell_mass[c] * moments[c, base] ** 2
            for a in range(len(pair)):
                for b in range(len(pair)):
                    total[c] += moments[c, base + 1 + count + pair[a, b]]
    return total


@kernel
def add_tested_momentum(corners, at_points, momentum, mean, tested):
    """Add sum_p q N_a (eta - mean_a) to tested (n_vertices, dim). Local.

    corners (n_cells or more, k) int32, local vertices. at_points : (start, shape, eta, moments) as of field_moments. momentum (n, dim), q, kg m/s or any other
    density times volume. mean (n_vertices, dim).
    """
    start, shape, eta, moments = at_points
    count = corners.shape[1] * (corners.shape[1] + 1) // 2
    for c in range(len(start) - 1):
        for d in range(eta.shape[1]):
            reference = moments[c, d * (1 + 2 * count)]
            for p in range(start[c], start[c + 1]):
                e = eta[p, d] - reference
                for a in range(corners.shape[1]):
                    v = corners[c, a]
                    tested[v, d] += momentum[p, d] * shape[p, a] * (e + (reference - mean[v, d]))


@kernel
def field_at_points(corners, at_points, mean, nodes, amplitude, field):
    """Store sum_a N_a (nodes_a + (eta - mean_a) amplitude_a) in field (n, dim). Local.

    mean, nodes, amplitude (n_vertices, dim); the others as in add_tested_momentum.
    """
    start, shape, eta, moments = at_points
    count = corners.shape[1] * (corners.shape[1] + 1) // 2
    for c in range(len(start) - 1):
        for d in range(eta.shape[1]):
            reference = moments[c, d * (1 + 2 * count)]
            for p in range(start[c], start[c + 1]):
                e, total = eta[p, d] - reference, 0.0
                for a in range(corners.shape[1]):
                    v = corners[c, a]
                    total += shape[p, a] * (nodes[v, d] + (e + (reference - mean[v, d])) * amplitude[v, d])
                field[p, d] = total


@kernel
def lost_energy(corners, start, mass, momentum, field, inside):
    """Return sum_p 1/2 (|q|^2 / m - m |field|^2), J, over cells with all vertices inside (n_vertices,) bool: what a projection has lost. Local."""
    lost = 0.0
    for c in range(len(start) - 1):
        whole = True
        for a in range(corners.shape[1]):
            whole = whole and inside[corners[c, a]]
        if whole:
            for p in range(start[c], start[c + 1]):
                for d in range(field.shape[1]):
                    lost += 0.5 * (momentum[p, d] ** 2 / mass[p] - mass[p] * field[p, d] ** 2)
    return lost
