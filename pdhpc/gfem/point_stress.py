"""Stress at the points of enriched cells: gradients of fields of the enriched space, and forces of stress on its functions."""
import numpy as np

from pdhpc.jit import kernel


@kernel
def gradient_at_points(corners, at_points, gradients, mean, nodes, amplitude, result):
    """Store grad sum_a N_a (nodes_a + (eta - mean_a) amplitude_a) in result (n, dim, dim), component first. Local.

    corners (n_cells, k) int32, local vertices. at_points : (start, shape, eta). gradients : (of the cells' functions (n, k, dim), of eta (n, dim, dim)), 1/m.
    mean, nodes, amplitude (n_vertices, dim), as of enrichment.Solution.
    """
    start, shape, eta = at_points
    of_shape, of_eta = gradients
    for c in range(len(start) - 1):
        for p in range(start[c], start[c + 1]):
            for d in range(eta.shape[1]):
                for j in range(of_shape.shape[2]):
                    total = 0.0
                    for a in range(shape.shape[1]):
                        v = corners[c, a]
                        total += of_shape[p, a, j] * (nodes[v, d] + (eta[p, d] - mean[v, d]) * amplitude[v, d])
                        total += shape[p, a] * of_eta[p, d, j] * amplitude[v, d]
                    result[p, d, j] = total


@kernel
def stress_2d(moduli, gradient, volume, result):
    """Store V sigma, N m, in result (n, 2, 2): moduli (n, 3, 3), Pa, in Voigt's notation xx, yy, xy; gradient (n, 2, 2) of the displacement. Local."""
    strain = np.empty(3)
    for p in range(len(gradient)):
        strain[0], strain[1], strain[2] = gradient[p, 0, 0], gradient[p, 1, 1], gradient[p, 0, 1] + gradient[p, 1, 0]
        for s in range(3):
            total = 0.0
            for t in range(3):
                total += moduli[p, s, t] * strain[t]
            if s < 2:
                result[p, s, s] = volume * total
            else:
                result[p, 0, 1] = result[p, 1, 0] = volume * total


@kernel
def add_stress_forces(corners, at_points, gradients, mean, stress, right, tested):
    """Subtract sum_p V sigma grad N_a from right, sum_p V sigma grad (N_a (eta - mean_a)) from tested, (n_vertices, dim) each. Local.

    stress (n, dim, dim), V sigma, N m; the others as in gradient_at_points.
    """
    start, shape, eta = at_points
    of_shape, of_eta = gradients
    for c in range(len(start) - 1):
        for p in range(start[c], start[c + 1]):
            for d in range(eta.shape[1]):
                along_eta = 0.0
                for j in range(of_eta.shape[2]):
                    along_eta += stress[p, d, j] * of_eta[p, d, j]
                for a in range(shape.shape[1]):
                    v, along = corners[c, a], 0.0
                    for j in range(of_shape.shape[2]):
                        along += stress[p, d, j] * of_shape[p, a, j]
                    right[v, d] -= along
                    tested[v, d] -= along * (eta[p, d] - mean[v, d]) + shape[p, a] * along_eta
