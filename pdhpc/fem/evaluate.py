"""Displacements, gradients, strains and stresses inside cells; nodal stresses; differences to known solutions."""
import math

import numpy as np

from pdhpc.fem.moduli import PAIRS
from pdhpc.kernels import cells as loops
from pdhpc.parallel.comm import exact_sum

_PIECE = 1 << 22  # numbers in a temporary array


def fields_in_cells(body, unknowns, xi, cells=slice(None)):
    """Return (u (n, n_points, dim), m, grad u (n, n_points, dim, dim), du_a/dx_b) of cells at reference coordinates xi (n_points, dim). Local.

    unknowns (n_vertices, width), ghosts up to date where `cells` have any.
    """
    mesh, basis = body.mesh, body.basis
    chosen = mesh.cells[cells]
    local = unknowns[chosen].reshape(len(chosen), basis.element.corners * basis.functions, mesh.dim)  # (cell, function, component)
    jacobian = np.einsum("fcx,qcd->fqxd", mesh.points[chosen], basis.element.gradient(xi))
    u = np.einsum("qk,fka->fqa", basis.shape(xi), local)
    by_reference = np.einsum("qkd,fka->fqad", basis.gradient(xi), local)
    return u, by_reference @ np.linalg.inv(jacobian)


def stresses_in_cells(body, unknowns, xi, cells=slice(None)):
    """Return (n, n_points, v), Pa, stresses in Voigt's order at reference coordinates xi (n_points, dim) of cells. Local."""
    gradient = fields_in_cells(body, unknowns, xi, cells)[1]
    strain = np.stack([gradient[..., a, b] + (gradient[..., b, a] if a != b else 0.0) for a, b in PAIRS[body.mesh.dim]], axis=-1)
    return np.einsum("fvw,fqw->fqv", body.moduli[body.kind[cells]], strain)


def cell_stresses(body, unknowns):
    """Return (n_owned_cells, v), Pa: stresses at the centres of owned cells. Local."""
    centre = body.basis.element.places.mean(axis=0)[None]
    mesh = body.mesh
    pieces = [stresses_in_cells(body, unknowns, centre, piece)[:, 0] for piece in _pieces(mesh.n_owned_cells, mesh.cells.shape[1] * body.width)]
    return np.concatenate(pieces) if pieces else np.zeros((0, len(PAIRS[mesh.dim])))


def nodal_stresses(body, stars, unknowns):
    """Return (n_owned, v), Pa: stresses at owned vertices, s_i = int N_i sigma / int N_i over the cells around i (lumped projection). Local.

    unknowns (n_vertices, width), ghosts up to date. Sums are over cells in ascending id.
    """
    mesh, element = body.mesh, body.basis.element
    xi, weights = body.basis.quadrature
    shape, width = element.shape(xi), len(PAIRS[mesh.dim])
    moments = np.empty((len(mesh.cells), element.corners, width + 1))
    for piece in _pieces(len(mesh.cells), len(xi) * mesh.dim**2 * 4):
        measures = np.tile(weights, (len(mesh.cells[piece]), 1))
        loops.measure(mesh.points, mesh.cells[piece], element.gradient(xi), measures)
        moments[piece, :, :width] = np.einsum("fq,qk,fqv->fkv", measures, shape, stresses_in_cells(body, unknowns, xi, piece))
        moments[piece, :, width] = measures @ shape
    sums = np.zeros((mesh.n_owned, width + 1))
    loops.gather(*stars, moments.reshape(len(mesh.cells), element.corners * (width + 1)), np.arange(mesh.n_owned, dtype=np.int32), 1.0, sums)
    return sums[:, :width] / sums[:, width:]


def errors(body, unknowns, displacement, gradient):
    """Return (L2 norm of u - u_exact, m^(1 + dim/2), H1 seminorm, m^(dim/2)) over the body. Collective over the mesh's ranks; the same bits on any number.

    displacement : points (n, dim) -> (n, dim), m. gradient : points -> (n, dim, dim), du_a/dx_b.
    """
    mesh, element = body.mesh, body.basis.element
    xi, weights = body.basis.fine_quadrature()
    squares = np.zeros((mesh.n_owned_cells, 2))
    for piece in _pieces(mesh.n_owned_cells, len(xi) * mesh.dim**2 * 4):
        chosen = mesh.cells[piece]
        measures = np.tile(weights, (len(chosen), 1))
        loops.measure(mesh.points, chosen, element.gradient(xi), measures)
        u, grad = fields_in_cells(body, unknowns, xi, piece)
        places = np.einsum("qc,fcx->fqx", element.shape(xi), mesh.points[chosen]).reshape(-1, mesh.dim)
        squares[piece, 0] = (measures * np.square(u - np.reshape(displacement(places), u.shape)).sum(axis=2)).sum(axis=1)
        squares[piece, 1] = (measures * np.square(grad - np.reshape(gradient(places), grad.shape)).sum(axis=(2, 3))).sum(axis=1)
    return tuple(math.sqrt(exact_sum(mesh.comm, squares[:, k])) for k in (0, 1))


def _pieces(n, size):
    """Return slices of n cells that need `size` numbers each."""
    step = max(1, _PIECE // size)
    return [slice(first, min(first + step, n)) for first in range(0, n, step)]
