"""Prescribed displacements and velocities on facets, for any basis: motions of the unknowns that these hold."""
import numpy as np

from pdhpc.conditions.loads import PrescribedMotion
from pdhpc.fem.loads import outward_normals


def prescribe_on_facets(body, nodes, facets, components, given, quantity="displacement"):
    """Return [PrescribedMotion] of the owned vertices of facets (of any rank). Collective over the mesh's ranks.

    In hats vertices are held. In a flat-top basis so are slopes along the facets, which are to be parallel to the axes: then u on the facets is the linear
    interpolation of what is given, and exact where that is linear.

    Parameters
    ----------
    body : Elasticity. nodes : Nodes of body.width unknowns. facets (n, facet corners) : as loads.facets_where. components : axes that are held.
    given : Given. quantity : "displacement" or "velocity".
    """
    mesh, dim = body.mesh, body.mesh.dim
    owned = mesh.points[: mesh.n_owned]
    held = body.basis.held_functions(_across(mesh, facets))
    gradients = given.gradient(owned) if callable(given.gradient) else np.zeros((len(owned), dim, dim))
    unknowns = body.basis.interpolated(mesh, given.values(owned), gradients)
    motions = []
    for pattern in _patterns(mesh.comm, held):
        chosen = np.flatnonzero((held == pattern).all(axis=1))
        places = [function * dim + axis for function in np.flatnonzero(pattern) for axis in components]
        values = unknowns[chosen].reshape(len(chosen), body.width)[:, places]
        motions.append(PrescribedMotion(nodes.owned_slots[chosen], places, values, given.time_function, quantity))
    return motions


class Given:
    """A prescribed field g(x) f(t): value, a vector (dim,), m or m/s, or a function points (n, dim) -> (n, dim); gradient, None or points -> (n, dim, dim)."""

    def __init__(self, value, time_function, gradient=None):
        self._value, self.time_function, self.gradient = value, time_function, gradient

    def values(self, points):
        """Return (n, dim) at points (n, dim), m. Local."""
        if callable(self._value):
            return np.asarray(self._value(points), float).reshape(points.shape) if len(points) else np.zeros(points.shape)
        return np.broadcast_to(np.asarray(self._value, float), points.shape)


def _across(mesh, facets):
    """Return (n_owned, dim) bool: the axes that facets at each owned vertex are most nearly normal to, facets of all ranks. Collective."""
    axis = np.abs(outward_normals(mesh, facets)).argmax(axis=1) if len(facets) else np.zeros(0, int)
    marks = np.zeros((len(mesh.points), mesh.dim))
    for column in facets.T:
        marks[column, axis] = 1.0
    bound = mesh.exchange.bind(marks)
    bound.accumulate()
    bound.free()
    return marks[: mesh.n_owned] > 0.0


def _patterns(comm, held):
    """Return the different rows of `held` with anything in them, of all ranks, in one order: so that works are registered alike everywhere. Collective."""
    own = np.unique(held, axis=0) if len(held) else held
    rows = np.unique(np.concatenate(comm.allgather(own)), axis=0)
    return [row for row in rows if row.any()]
