"""Find the cell that a point lies in, and where in it."""
import numpy as np

from pdhpc.fem.facets import UNIT_CORNERS
from pdhpc.jit import kernel

_EDGE = 1e-9  # reference coordinate: how far outside a cell a point still belongs to it
_ITERATIONS = 30  # of Newton's method; one is enough where opposite edges are parallel


def find_cells(mesh, points):
    """Return (cell, reference): (n,) int32, the owned cell around each point or -1, and (n, dim), where in it. Local.

    Reference coordinates are those of facets.UNIT_CORNERS, zero without a cell. On a common facet, edge or vertex the cell with the smallest id has the point:
    over all ranks each point of the body is found exactly once. Every cell tests the points of its range along one axis, so that the cost grows as the
    number of cells plus the number of pairs (cell, point within the range).

    points : (n, dim), m.
    """
    points = np.asarray(points, float).reshape(-1, mesh.dim)
    axis = int(np.argmax(np.ptp(points, axis=0))) if len(points) else 0
    order = np.argsort(points[:, axis], kind="stable")
    found, reference = np.full(len(points), -1, np.int32), np.zeros(points.shape)
    corners = UNIT_CORNERS[mesh.kind].astype(float)
    _search(mesh.points, mesh.cells, mesh.cell_id, corners, mesh.kind in ("triangle", "tetra"), points[order], axis, found, reference)
    cell, place = np.empty_like(found), np.empty_like(reference)
    cell[order], place[order] = found, reference
    foreign = cell >= mesh.n_owned_cells
    cell[foreign] = -1
    place[cell < 0] = 0.0
    return cell, place


@kernel
def _search(vertices, cells, cell_id, corners, simplex, points, axis, found, reference):
    """Set found[n] to the cell with the smallest id around points[n], ascending along `axis`, and reference[n] to the place in it."""
    dim = points.shape[1]
    low, high, place, jacobian = np.empty(dim), np.empty(dim), np.empty(dim), np.empty((dim, dim))
    along = points[:, axis].copy()
    for c in range(len(cells)):
        for d in range(dim):
            low[d], high[d] = np.inf, -np.inf
            for k in range(cells.shape[1]):
                low[d], high[d] = min(low[d], vertices[cells[c, k], d]), max(high[d], vertices[cells[c, k], d])
            slack = _EDGE * (high[d] - low[d])
            low[d], high[d] = low[d] - slack, high[d] + slack
        for n in range(np.searchsorted(along, low[axis]), len(along)):
            if along[n] > high[axis]:
                break
            near = True
            for d in range(dim):
                near = near and low[d] <= points[n, d] <= high[d]
            if near and (found[n] < 0 or cell_id[c] < cell_id[found[n]]) and _invert(vertices, cells[c], corners, simplex, points[n], place, jacobian):
                found[n] = c
                reference[n] = place


@kernel
def _invert(vertices, cell, corners, simplex, point, place, jacobian):
    """Set place to xi with sum_k N_k(xi) x_k = point by Newton's method; return whether xi lies in the reference cell."""
    dim = len(point)
    place[:] = 0.5
    rest, shape = np.empty(dim), np.empty(dim + 1)
    for _ in range(_ITERATIONS):
        rest[:] = point
        jacobian[:] = 0.0
        for k in range(len(cell)):
            _shape(corners[k], place, simplex, k, shape)
            for d in range(dim):
                x = vertices[cell[k], d]
                rest[d] -= shape[dim] * x
                for m in range(dim):
                    jacobian[d, m] += shape[m] * x
        step = _solve(jacobian, rest)
        for m in range(dim):
            place[m] = min(max(place[m] + rest[m], -1.0), 2.0)
        if step < 1e-13:
            break
    total = 0.0
    for m in range(dim):
        total += place[m]
        if not -_EDGE <= place[m] <= 1.0 + _EDGE:
            return False
    return not simplex or total <= 1.0 + _EDGE


@kernel
def _shape(corner, place, simplex, number, shape):
    """Set shape[: dim] to the gradient and shape[dim] to the value of a corner's shape function at `place`."""
    dim = len(place)
    if simplex:
        shape[dim] = 1.0 if number == 0 else place[number - 1]
        for m in range(dim):
            shape[m] = -1.0 if number == 0 else corner[m]
            if number == 0:
                shape[dim] -= place[m]
        return
    shape[:] = 1.0
    for m in range(dim):
        value, slope = (place[m], 1.0) if corner[m] > 0.5 else (1.0 - place[m], -1.0)
        for other in range(dim):
            shape[other] *= slope if other == m else value
        shape[dim] *= value


@kernel
def _solve(matrix, right):
    """Set right to matrix^-1 right, (dim, dim) of 2 or 3; return the largest magnitude of its entries."""
    a, x, y = matrix, right[0], right[1]
    if len(right) == 2:
        det = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
        right[0], right[1] = (x * a[1, 1] - a[0, 1] * y) / det, (a[0, 0] * y - x * a[1, 0]) / det
        return max(abs(right[0]), abs(right[1]))
    z = right[2]
    m0, m1, m2 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1], a[1, 0] * a[2, 2] - a[1, 2] * a[2, 0], a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    det = a[0, 0] * m0 - a[0, 1] * m1 + a[0, 2] * m2
    right[0] = (x * m0 - a[0, 1] * (y * a[2, 2] - a[1, 2] * z) + a[0, 2] * (y * a[2, 1] - a[1, 1] * z)) / det
    right[1] = (a[0, 0] * (y * a[2, 2] - a[1, 2] * z) - x * m1 + a[0, 2] * (a[1, 0] * z - y * a[2, 0])) / det
    right[2] = (a[0, 0] * (a[1, 1] * z - y * a[2, 1]) - a[0, 1] * (a[1, 0] * z - y * a[2, 0]) + x * m2) / det
    return max(abs(right[0]), max(abs(right[1]), abs(right[2])))
