"""Strain and stress of a mesh at its vertices: those of the cells around, taken at the vertex and averaged."""
import numpy as np

from pdhpc.jit import kernel
from pdhpc.kernels.cells import _invert, _jacobian


@kernel
def recover_strain(points, cells, shape_gradient, displacement, stars, strain):
    """Store epsilon_v = sum_c w_c sym grad u|_c(x_v) / sum_c w_c in strain (n_owned, dim, dim), w_c = det(dx/dxi) of cell c at the vertex.

    points (n_vertices, dim), m; cells (n_cells, corners); shape_gradient (corners, corners, dim), at the corners; displacement (n_vertices, dim), m;
    stars : (start (n_owned + 1,), cell, corner), cells in ascending id, so that sums have the same bits on any number of ranks.
    """
    start, cell, corner = stars
    dim = points.shape[1]
    jacobian, inverse, gradient = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim, dim))
    for v in range(len(strain)):
        strain[v] = 0.0
        weight = 0.0
        for k in range(start[v], start[v + 1]):
            corners, at = cells[cell[k]], shape_gradient[corner[k]]
            _jacobian(points, corners, at, jacobian)
            det = _invert(jacobian, inverse, dim)
            _jacobian(displacement, corners, at, gradient)
            weight += det
            for a in range(dim):
                for b in range(dim):
                    for d in range(dim):
                        part = 0.5 * det * gradient[a, d] * inverse[d, b]
                        strain[v, a, b] += part
                        strain[v, b, a] += part
        if weight > 0.0:
            for a in range(dim):
                for b in range(dim):
                    strain[v, a, b] /= weight


@kernel
def recover_stress(points, cells, shape_gradient, displacement, stars, tensors, kind, stress):
    """Store sigma_v = sum_c w_c C_c : grad u|_c(x_v) / sum_c w_c in stress (n_owned, dim, dim), Pa; see recover_strain.

    tensors (n_kind, dim, dim, dim, dim), Pa; kind (n_cells,).
    """
    start, cell, corner = stars
    dim = points.shape[1]
    jacobian, inverse, gradient, full = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim, dim))
    for v in range(len(stress)):
        stress[v] = 0.0
        weight = 0.0
        for k in range(start[v], start[v + 1]):
            corners, at, c = cells[cell[k]], shape_gradient[corner[k]], tensors[kind[cell[k]]]
            _jacobian(points, corners, at, jacobian)
            det = _invert(jacobian, inverse, dim)
            _jacobian(displacement, corners, at, gradient)
            weight += det
            for a in range(dim):
                for b in range(dim):
                    full[a, b] = 0.0
                    for d in range(dim):
                        full[a, b] += gradient[a, d] * inverse[d, b]
            for a in range(dim):
                for b in range(dim):
                    for m in range(dim):
                        for n in range(dim):
                            stress[v, a, b] += det * c[a, b, m, n] * full[m, n]
        if weight > 0.0:
            for a in range(dim):
                for b in range(dim):
                    stress[v, a, b] /= weight
