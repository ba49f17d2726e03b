"""Sweeps over the cells of a mesh: their stiffness and mass by quadrature, the nodal forces of each, and what vertices gather from the cells around them.

Matrices of cells come from a table: cell c has row index[c] of it, so that equal cells share one. A cell's unknowns are numbered (m, a): function m of its
basis, component a. Every sum has an order that cells and vertices bring along (ascending ids), so that results have the same bits on any number of ranks.
"""
import numpy as np

from pdhpc.jit import inlined, kernel
from pdhpc.kernels.simd import LANES, fma, load8, splat, store8


@inlined
def _invert(jacobian, inverse, dim):
    """Store the inverse of a (dim, dim) matrix and return its determinant."""
    if dim == 2:
        det = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]
        inverse[0, 0], inverse[0, 1] = jacobian[1, 1] / det, -jacobian[0, 1] / det
        inverse[1, 0], inverse[1, 1] = -jacobian[1, 0] / det, jacobian[0, 0] / det
        return det
    for a in range(3):
        for b in range(3):
            c, d, e, f = (b + 1) % 3, (b + 2) % 3, (a + 1) % 3, (a + 2) % 3
            inverse[a, b] = jacobian[c, e] * jacobian[d, f] - jacobian[c, f] * jacobian[d, e]
    det = jacobian[0, 0] * inverse[0, 0] + jacobian[0, 1] * inverse[1, 0] + jacobian[0, 2] * inverse[2, 0]
    for a in range(3):
        for b in range(3):
            inverse[a, b] /= det
    return det


@inlined
def _jacobian(points, corners, gradient, jacobian):
    """Store dx_a/dxi_d = sum_i x_ia dN_i/dxi_d of one cell at one point; gradient (corners, dim)."""
    dim = points.shape[1]
    for a in range(dim):
        for d in range(dim):
            total = 0.0
            for i in range(len(corners)):
                total += points[corners[i], a] * gradient[i, d]
            jacobian[a, d] = total


@kernel
def measure(points, cells, shape_gradient, weight):
    """Store w det(dx/dxi), m^dim, at all quadrature points of all cells in weight (n_cells, n_points), which holds w before.

    Returns the first cell with a determinant that is not above 0, or -1. points (n_vertices, dim), m; shape_gradient (n_points, corners, dim).
    """
    dim = points.shape[1]
    jacobian, inverse, bad = np.empty((dim, dim)), np.empty((dim, dim)), -1
    for c in range(len(cells)):
        for q in range(len(shape_gradient)):
            _jacobian(points, cells[c], shape_gradient[q], jacobian)
            det = _invert(jacobian, inverse, dim)
            if bad < 0 and not det > 0.0:
                bad = c
            weight[c, q] *= det
    return bad


@inlined
def _physical(points, corners, shape_gradient, basis_gradient, jacobian, inverse, gradient):
    """Store the gradients (n_basis, dim), 1/m, of a cell's basis at one point; return det(dx/dxi)."""
    dim = points.shape[1]
    _jacobian(points, corners, shape_gradient, jacobian)
    det = _invert(jacobian, inverse, dim)
    for m in range(len(basis_gradient)):
        for a in range(dim):
            total = 0.0
            for d in range(dim):
                total += basis_gradient[m, d] * inverse[d, a]
            gradient[m, a] = total
    return det


@kernel
def stiffnesses(points, cells, shape_gradient, basis_gradient, weight, moduli, kind, table):
    """Store the stiffness of each cell, K_(m a)(n b) = sum_q w det sum_cd G_mc D_acbd G_nd, in table (n_cells, n, n).

    points (n_vertices, dim), m; cells (n_cells, corners); shape_gradient (n_points, corners, dim), basis_gradient (n_points, n_basis, dim): of the map and
    of the basis by reference coordinates; weight (n_points,), 2D: times the thickness; moduli (n_kind, dim, dim, dim, dim), Pa, D; kind (n_cells,); n = n_basis dim.
    """
    dim, count = points.shape[1], basis_gradient.shape[1]
    jacobian, inverse, gradient = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((count, dim))
    pulled = np.empty((dim, dim, dim))  # sum_d D_acbd G_nd of one n
    for c in range(len(cells)):
        table[c] = 0.0
        law = moduli[kind[c]]
        for q in range(len(weight)):
            factor = weight[q] * _physical(points, cells[c], shape_gradient[q], basis_gradient[q], jacobian, inverse, gradient)
            for n in range(count):
                for a in range(dim):
                    for e in range(dim):
                        for b in range(dim):
                            total = 0.0
                            for d in range(dim):
                                total += law[a, e, b, d] * gradient[n, d]
                            pulled[e, a, b] = factor * total
                for m in range(count):
                    for a in range(dim):
                        for b in range(dim):
                            total = 0.0
                            for e in range(dim):
                                total += gradient[m, e] * pulled[e, a, b]
                            table[c, m * dim + a, n * dim + b] += total


@kernel
def masses(points, cells, shape_gradient, basis, weight, density, kind, table):
    """Store M_mn = sum_q w det rho phi_m phi_n, kg, of each cell in table (n_cells, n_basis, n_basis); basis (n_points, n_basis), density (n_kind,), kg/m^3."""
    dim, count = points.shape[1], basis.shape[1]
    jacobian, inverse = np.empty((dim, dim)), np.empty((dim, dim))
    for c in range(len(cells)):
        table[c] = 0.0
        for q in range(len(weight)):
            _jacobian(points, cells[c], shape_gradient[q], jacobian)
            factor = density[kind[c]] * weight[q] * _invert(jacobian, inverse, dim)
            for m in range(count):
                for n in range(count):
                    table[c, m, n] += factor * basis[q, m] * basis[q, n]


@kernel
def cell_forces(cells, slots, index, table, field, chosen, forces):
    """Store K u of the cells `chosen` (n,) in forces (n_cells, padded).

    cells (n_cells, corners), local vertices; slots (n_vertices,), rows of `field` (n_slots, width); index (n_cells,); table (n_kind, n, padded): row j is
    that of the symmetric matrix, n = corners * width, padded with zeros to a multiple of 8.
    """
    width, n, padded = field.shape[1], table.shape[1], table.shape[2]
    local, flat = np.empty(n), table.reshape(-1)
    out = forces.reshape(-1)
    for number in range(len(chosen)):
        c = chosen[number]
        for k in range(cells.shape[1]):
            slot = slots[cells[c, k]]
            for a in range(width):
                local[k * width + a] = field[slot, a]
        first = np.int64(index[c]) * n * padded
        for block in range(0, padded, LANES):
            even, odd = splat(0.0), splat(0.0)
            for j in range(0, n - 1, 2):
                even = fma(load8(flat, first + j * padded + block), splat(local[j]), even)
                odd = fma(load8(flat, first + (j + 1) * padded + block), splat(local[j + 1]), odd)
            if n % 2:
                even = fma(load8(flat, first + (n - 1) * padded + block), splat(local[n - 1]), even)
            store8(out, c * padded + block, even + odd)


@kernel
def gather(start, cell, corner, forces, slots, sign, field):
    """field[slots[v]] = sign times the sum of the forces on vertex v of the cells around it, in the order that they are listed; field (n_slots, width).

    start (n_owned + 1,), cell, corner: the cells around owned vertices and which of their corners the vertex is; forces (n_cells, padded).
    """
    width = field.shape[1]
    for v in range(len(start) - 1):
        for a in range(width):
            total = 0.0
            for k in range(start[v], start[v + 1]):
                total += forces[cell[k], corner[k] * width + a]
            field[slots[v], a] = sign * total


@kernel
def cell_energies(cells, slots, field, forces, energy):
    """Store u . K u / 2, J, of the first len(energy) cells; forces (n_cells, padded) as of cell_forces."""
    width = field.shape[1]
    for c in range(len(energy)):
        total = 0.0
        for k in range(cells.shape[1]):
            for a in range(width):
                total += field[slots[cells[c, k]], a] * forces[c, k * width + a]
        energy[c] = 0.5 * total


@kernel
def stars(cells, order, n_owned, start, cell, corner):
    """List the cells around each of the first n_owned vertices in the given order (n_cells,) of cells; start (n_owned + 1,) zeros before."""
    for c in range(len(cells)):
        for k in range(cells.shape[1]):
            if cells[c, k] < n_owned:
                start[cells[c, k] + 1] += 1
    for v in range(n_owned):
        start[v + 1] += start[v]
    filled = start[:-1].copy()
    for number in range(len(order)):
        c = order[number]
        for k in range(cells.shape[1]):
            v = cells[c, k]
            if v < n_owned:
                cell[filled[v]], corner[filled[v]] = c, k
                filled[v] += 1


@kernel
def count_columns(cells, start, cell, n_vertices, row_start):
    """Store in row_start (n_owned + 1,) where the rows of a matrix begin that has a column for every vertex of the cells around each owned one."""
    last = np.full(n_vertices, -1, np.int64)
    for v in range(len(start) - 1):
        count = 0
        for k in range(start[v], start[v + 1]):
            for corner in range(cells.shape[1]):
                other = cells[cell[k], corner]
                if last[other] != v:
                    last[other] = v
                    count += 1
        row_start[v + 1] = row_start[v] + count


@kernel
def list_columns(cells, start, cell, vertex_id, row_start, column):
    """Store those columns in column (n,), local vertices by ascending id."""
    last = np.full(len(vertex_id), -1, np.int64)
    for v in range(len(start) - 1):
        end = row_start[v]
        for k in range(start[v], start[v + 1]):
            for corner in range(cells.shape[1]):
                other = cells[cell[k], corner]
                if last[other] == v:
                    continue
                last[other] = v
                place = end
                while place > row_start[v] and vertex_id[column[place - 1]] > vertex_id[other]:
                    column[place] = column[place - 1]
                    place -= 1
                column[place] = other
                end += 1


@kernel
def add_matrices(cells, star, index, table, factor, row_start, column, value):
    """Add factor times the cells' matrices to blocks value (n, width, width), cells in ascending id; star: (start, cell, corner) of Stars."""
    start, cell, corner = star
    width, most = value.shape[1], 0
    for v in range(len(start) - 1):
        for k in range(row_start[v], row_start[v + 1]):
            most = max(most, column[k] + 1)
    place = np.empty(most, np.int64)
    for v in range(len(start) - 1):
        for k in range(row_start[v], row_start[v + 1]):
            place[column[k]] = k
        for k in range(start[v], start[v + 1]):
            matrix, row = table[index[cell[k]]], np.int64(corner[k]) * width
            for other in range(cells.shape[1]):
                block = value[place[cells[cell[k], other]]]
                for a in range(width):
                    for b in range(width):
                        block[a, b] += factor * matrix[row + a, other * width + b]


@kernel
def multiply_blocks(row_start, column, value, x, y):
    """y = A x; x (n_vertices, width), y (n_owned, width)."""
    width = value.shape[1]
    for v in range(len(row_start) - 1):
        for a in range(width):
            total = 0.0
            for k in range(row_start[v], row_start[v + 1]):
                for b in range(width):
                    total += value[k, a, b] * x[column[k], b]
            y[v, a] = total


@kernel
def scalar_rows(row_start, column, value, fixed, number, start, columns, values):
    """Write blocks as rows of numbers; entries of fixed rows and columns become 0, but for the diagonal.

    fixed (n_vertices, width) bool; number (n_vertices,), the global block of each vertex; start (n_owned width + 1,), columns, values (n width^2,): the result.
    """
    width, place = value.shape[1], 0
    for v in range(len(row_start) - 1):
        for a in range(width):
            for k in range(row_start[v], row_start[v + 1]):
                j = column[k]
                for b in range(width):
                    diagonal = j == v and a == b
                    columns[place] = number[j] * width + b
                    values[place] = 0.0 if (fixed[v, a] or fixed[j, b]) and not diagonal else value[k, a, b]
                    place += 1
            start[v * width + a + 1] = place
