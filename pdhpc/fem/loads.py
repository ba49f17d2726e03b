"""Consistent nodal loads: tractions integrated over facets, body forces and gravity over cells; and the choice of facets and vertices they act on."""
import numpy as np

from pdhpc.conditions.loads import BodyForce
from pdhpc.fem.cuts import parts
from pdhpc.fem.elements import ELEMENTS
from pdhpc.kernels import cells as loops
from pdhpc.parallel.comm import largest

_PIECE = 1 << 14  # cells looked at together: bounds the temporary memory
_INWARD = 1e-9  # of a facet's size: how far inside of the body is asked whether it lies in a shape


def facets_where(mesh, where):
    """Return (facets (n, facet corners), cell (n,)) of the facets on the body's surface, of owned cells, that a function chooses. Local.

    where : function (centres (n, dim), m, outward unit normals (n, dim)) -> (n,) bool.
    """
    facets, cell = mesh.boundary()
    centres, normals = mesh.points[facets].mean(axis=1), outward_normals(mesh, facets)
    chosen = np.asarray(where(centres, normals), bool) if len(facets) else np.zeros(0, bool)
    return facets[chosen], cell[chosen]


def facets_of_set(mesh, name):
    """Return (facets, cell) of a set of the mesh's file, as facets_where. Local.

    Raises
    ------
    ValueError: the mesh has no such set.
    """
    if name not in mesh.sets:
        raise ValueError(f"the mesh has no set {name!r}; it has {', '.join(sorted(mesh.sets)) or 'none'}")
    facets, cell = mesh.boundary()
    chosen = np.isin(_as_records(facets), _as_records(mesh.sets[name]))
    return facets[chosen], cell[chosen]


def _as_records(facets):
    """Return (n,) records that are equal where facets have the same vertices."""
    rows = np.ascontiguousarray(np.sort(facets, axis=1).astype(np.int32))
    return rows.view([(f"v{k}", np.int32) for k in range(rows.shape[1])]).ravel()


def vertices_of(mesh, facets):
    """Return (n_owned,) bool: owned vertices of facets on any rank. Collective over the mesh's ranks."""
    marked = np.zeros((len(mesh.points), 1))
    marked[facets.ravel()] = 1.0
    bound = mesh.exchange.bind(marked)
    bound.accumulate()
    bound.free()
    return marked[: mesh.n_owned, 0] > 0.0


def traction_loads(body, facets, cell, traction, shape=None):
    """Return (n_owned, width), N: integrals of traction times each function over facets, to the same bits on any number of ranks. Collective over them.

    Parameters
    ----------
    body : Elasticity. facets (n, facet corners), cell (n,) : as facets_where.
    traction : (dim,), Pa, or function (points (n, dim), m, outward unit normals (n, dim)) -> (n, dim), Pa.
    shape : None, or a convex shape: integrals are over the part of the facets in it, see fem.cuts.
    """
    mesh, basis = body.mesh, body.basis
    element = basis.element
    surface = ELEMENTS[element.facet]
    inside = mesh.points[facets]
    if shape is not None:
        inside = inside - _INWARD * np.ptp(inside, axis=1).max(axis=1)[:, None, None] * outward_normals(mesh, facets)[:, None]
    result = np.zeros((len(mesh.points), body.width))
    for corners in element.facets:
        mine = np.flatnonzero((mesh.cells[cell][:, corners] == facets).all(axis=1))
        loads = np.zeros((len(mine), element.corners, body.width))
        for chosen, s, weights in parts(surface, inside[mine], shape, basis.facet_quadrature(), basis.kinks):
            flat, x = s.reshape(-1, surface.dim), mesh.points[facets[mine[chosen]]]
            functions = basis.shape(surface.shape(flat) @ element.places[corners]).reshape(*s.shape[:2], -1)
            area = _area_vectors(np.einsum("fcx,fqcs->fqxs", x, surface.gradient(flat).reshape(*s.shape[:2], surface.corners, surface.dim)))
            size = np.linalg.norm(area, axis=2)
            places = np.einsum("fqc,fcx->fqx", surface.shape(flat).reshape(*s.shape[:2], surface.corners), x)
            t = _values(traction, places, area / size[:, :, None])
            loads[chosen] = np.einsum("fq,fqk,fqa->fka", body.thickness * weights * size, functions, t).reshape(len(x), element.corners, body.width)
        _add_exactly(result, mesh.cells[cell[mine]], loads, mesh.comm)
    bound = mesh.exchange.bind(result)
    bound.accumulate()
    bound.free()
    return result[: mesh.n_owned]


def body_loads(body, stars, density):
    """Return (n_owned, width), N: integrals of a force density times each function over the cells, summed in ascending id. Local.

    density : (dim,), N/m^3, or (n_cells, dim), or function points (n, dim), m -> (n, dim), N/m^3.
    """
    mesh, basis = body.mesh, body.basis
    element = basis.element
    xi, weights = basis.quadrature
    measures = np.tile(body.thickness * weights, (len(mesh.cells), 1))
    loops.measure(mesh.points, mesh.cells, element.gradient(xi), measures)
    if callable(density):
        b = _values(density, np.einsum("qc,fcx->fqx", element.shape(xi), mesh.points[mesh.cells]))
    else:
        b = np.broadcast_to(np.asarray(density, float).reshape(-1, 1, mesh.dim), (len(mesh.cells), len(xi), mesh.dim))
    loads = np.einsum("fq,qk,fqa->fka", measures, basis.shape(xi), b)
    result = np.zeros((mesh.n_owned, body.width))
    loops.gather(*stars, loads.reshape(len(mesh.cells), element.corners * body.width), np.arange(mesh.n_owned, dtype=np.int32), 1.0, result)
    return result


def body_loads_within(body, stars, density, shape):
    """Return (n_owned, width), N: as body_loads over the part of each cell in a convex shape, see fem.cuts; density (n_cells, dim), N/m^3. Local."""
    mesh, basis = body.mesh, body.basis
    element = basis.element
    loads = np.zeros((len(mesh.cells), element.corners * basis.functions, mesh.dim))
    for first in range(0, len(mesh.cells), _PIECE):
        x = mesh.points[mesh.cells[first : first + _PIECE]]
        for chosen, xi, weights in parts(element, x, shape, basis.quadrature, basis.kinks):
            flat = xi.reshape(-1, mesh.dim)
            gradient = element.gradient(flat).reshape(*xi.shape[:2], element.corners, mesh.dim)
            jacobian = sum(x[chosen, None, corner, :, None] * gradient[:, :, corner, None] for corner in range(element.corners))
            measures = body.thickness * weights * _determinants(jacobian)
            functions = np.ascontiguousarray(basis.shape(flat).reshape(*xi.shape[:2], -1).transpose(0, 2, 1))
            integrals = (measures[:, None] * functions).sum(axis=2)
            loads[first + chosen] = integrals[:, :, None] * density[first + chosen, None]
    result = np.zeros((mesh.n_owned, body.width))
    loops.gather(*stars, loads.reshape(len(mesh.cells), element.corners * body.width), np.arange(mesh.n_owned, dtype=np.int32), 1.0, result)
    return result


def gravity_loads(body, stars, acceleration):
    """Return (n_owned, width), N: the weight rho g of the cells; acceleration (dim,), m/s^2. Local."""
    return body_loads(body, stars, body.density[body.kind][:, None] * np.asarray(acceleration, float))


def nodal_load(nodes, values, time_function):
    """Return the BodyForce of nodal loads (n_owned, dim), N, at f = 1, on the vertices that have any. Local."""
    loaded = np.flatnonzero(values.any(axis=1))
    return BodyForce(nodes.owned_slots[loaded], values[loaded], time_function)


def _values(given, places, *more):
    """Return (n_facets or cells, n_points, dim) of a constant or a function of points (and normals)."""
    if not callable(given):
        return np.broadcast_to(np.asarray(given, float), places.shape)
    flat = [each.reshape(-1, places.shape[-1]) for each in (places, *more)]
    return np.asarray(given(*flat), float).reshape(places.shape) if len(flat[0]) else np.zeros(places.shape)


def _area_vectors(tangents):
    """Return (..., dim): outward normals times dA per reference area; tangents (..., dim, dim - 1)."""
    if tangents.shape[-1] == 1:
        return np.stack([tangents[..., 1, 0], -tangents[..., 0, 0]], axis=-1)
    return np.cross(tangents[..., 0], tangents[..., 1])


def _determinants(jacobian):
    """Return (...,) of matrices (..., dim, dim)."""
    return (_area_vectors(jacobian[..., 1:]) * jacobian[..., 0]).sum(axis=-1)


def outward_normals(mesh, facets):
    """Return (n, dim) outward unit normals at the middles of facets. Local."""
    surface = ELEMENTS[ELEMENTS[mesh.kind].facet]
    along = surface.gradient(surface.places.mean(axis=0))[0]
    area = _area_vectors(np.einsum("fcx,cs->fxs", mesh.points[facets], along))
    return area / np.linalg.norm(area, axis=1)[:, None]


def _add_exactly(result, vertices, loads, comm):
    """Add loads (n, corners, width) to the rows `vertices` (n, corners) so that no sum is rounded: all are first rounded to a common grid. Collective.

    The grid is 2^-46 of the largest load, so that 64 of them still add exactly, in any order and on any number of ranks.
    """
    most = largest(comm, float(np.abs(loads).max(initial=0.0)))
    if most > 0.0:
        grid = 2.0 ** (np.frexp(most)[1] - 46)
        np.add.at(result, vertices, np.rint(loads / grid) * grid)
