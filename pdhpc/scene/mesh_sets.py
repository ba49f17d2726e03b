"""Scene -> the cells, facets and vertices of its regions, and the loads, motions and initial states that act on them."""
import numpy as np

from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.fem.elements import ELEMENTS
from pdhpc.fem.loads import body_loads, facets_of_set, facets_where, traction_loads, vertices_of
from pdhpc.scene.body import make_shape
from pdhpc.scene.conditions import time_function
from pdhpc.scene.sections import section
from pdhpc.scene.sentences import nearest

_PIECE = 1 << 14  # cells looked at together: bounds the temporary memory
_NUDGE = 1e-6  # of the way to the middle of a cell: on which side of a region's boundary something lies is asked a little inside of the cell
_ALIGNED = 0.99  # cosine of the angle between a facet's normal and a face from which on the facet counts as part of it
_SAMPLES = 8  # points along each axis of a cell that its share in a region is counted with


class MeshSets:
    """Regions of a scene on a mesh; every selection is Collective and holds something, or raises a SceneError that names `key`."""

    def __init__(self, scene, body, comm):
        """body : MeshBody. Collective.

        Raises
        ------
        SceneError, on every rank: a region of a group that the mesh does not have.
        """
        self.scene, self.body, self.mesh, self.comm = scene, body, body.mesh, comm
        self._of_facets, self._of_cells = (sorted(set().union(*comm.allgather(set(names)))) for names in (self.mesh.sets, self.mesh.regions))
        known = list(dict.fromkeys(self._of_facets + self._of_cells))
        for number, region in enumerate(scene.region):
            if region.shape == "group" and region.group not in known:
                allowed = f"a group of {scene.mesh.file} ({', '.join(known) or 'it has none'}){nearest(region.group, known)}"
                raise scene.error(f"{section('region', number, region)}: group", f'"{region.group}"', allowed)

    def shares(self, name, key):
        """Return (n_cells,) float, the share of each local cell's volume in a region."""
        region = self._region(name)
        if region is None:
            return np.ones(len(self.mesh.cells))
        if region.shape == "group":
            if region.group not in self._of_cells:
                allowed = f"a region of cells: {self.scene.mesh.file} has {', '.join(self._of_cells) or 'no groups of them'}"
                raise self.scene.error(key, f'"{name}", whose group "{region.group}" is one of facets', allowed)
            found = self._cells(region.group).astype(float)
        else:
            shape, found = make_shape(region), np.empty(len(self.mesh.cells))
            points = _samples(self.mesh.kind)
            functions = ELEMENTS[self.mesh.kind].shape(points)
            for piece, corners in self._pieces():
                places = np.einsum("qc,ncd->nqd", functions, corners)
                found[piece] = shape.contains(places.reshape(-1, self.mesh.dim)).reshape(len(corners), -1).mean(axis=1)
            found *= self._in_body(region)
        self._hold(found[: self.mesh.n_owned_cells].any(), name, key, "cell")
        return found

    def vertices(self, name, key):
        """Return (n_owned,) bool, owned vertices in a region: those of a group, or at which one of the cells around is within the region."""
        region, mesh = self._region(name), self.mesh
        if region is None:
            return np.ones(mesh.n_owned, bool)
        if region.shape == "group":
            if region.group in self._of_facets:
                found = vertices_of(mesh, self._set(region.group)[0])
            else:
                found = self._marked(self._cells(region.group))
        else:
            shape, inside = make_shape(region), np.empty(mesh.cells.shape, bool)
            for piece, corners in self._pieces():
                nudged = corners + _NUDGE * (corners.mean(axis=1, keepdims=True) - corners)
                inside[piece] = shape.contains(nudged.reshape(-1, mesh.dim)).reshape(len(corners), -1)
            found = self._marked(inside & self._in_body(region)[:, None])
        self._hold(found.any(), name, key, "vertex")
        return found

    def facets(self, name, face, key):
        """Return (facets, cell) on the surface, as fem.loads.facets_where, in a region and with the outward normal `face` ("+x", ...; None: any)."""
        region, mesh = self._region(name), self.mesh
        direction = np.zeros(mesh.dim)
        if face is not None:
            direction["xyz".index(face[1])] = 1.0 if face[0] == "+" else -1.0
        inward = 1e-3 * _NUDGE * float(np.max(np.ptp(mesh.points, axis=0))) if len(mesh.points) else 0.0

        def where(centres, normals):
            chosen = np.ones(len(centres), bool) if face is None else normals @ direction > _ALIGNED
            if region is not None and region.shape != "group":
                chosen &= make_shape(region).contains(centres - inward * normals)
            return chosen

        facets, cell = facets_where(mesh, where)
        if region is not None:
            keep = self._in_body(region)[cell] if region.shape != "group" else self._in_group(region.group, facets, cell)
            facets, cell = facets[keep], cell[keep]
        self._hold(len(facets) > 0, name, key, "facet" if face is None else f"facet with the outward normal {face}")
        return facets, cell

    def facets_between(self, members):
        """Return (n, facet corners): facets of owned cells on the surface whose vertices are all among the ranks' owned vertices `members`. Collective."""
        mesh = self.mesh
        marks = np.zeros((len(mesh.points), 1))
        marks[members] = 1.0
        bound = mesh.exchange.bind(marks)
        bound.refresh()
        bound.free()
        facets, _ = mesh.boundary()
        return facets[(marks[facets, 0] > 0.0).all(axis=1)]

    def _region(self, name):
        """Return the table of a region, None for "all"."""
        return None if name == "all" else next(each for each in self.scene.region if each.name == name)

    def _in_body(self, region):
        """Return (n_cells,) bool, the cells of the region's body."""
        if region.body is None:
            return np.ones(len(self.mesh.cells), bool)
        return self.body.number == [each.name for each in self.scene.body].index(region.body)

    def _in_group(self, group, facets, cell):
        """Return (n,) bool, which facets belong to a group of facets or of cells."""
        if group not in self._of_facets:
            return self._cells(group)[cell]
        mine = {tuple(sorted(each)) for each in self._set(group)[0].tolist()}
        return np.array([tuple(sorted(each)) in mine for each in facets.tolist()], bool)

    def _cells(self, group):
        """Return (n_cells,) bool, the local cells of a group."""
        return self.mesh.regions.get(group, np.zeros(len(self.mesh.cells), bool))

    def _set(self, group):
        if group in self.mesh.sets:
            return facets_of_set(self.mesh, group)
        facets, cell = self.mesh.boundary()
        return facets[:0], cell[:0]

    def _marked(self, corners):
        """Return (n_owned,) bool, owned vertices of marked corners (n_cells, corners), or of marked cells (n_cells,). Local: all cells around them are here."""
        marks = np.zeros(len(self.mesh.points), bool)
        marks[self.mesh.cells[corners].ravel()] = True
        return marks[: self.mesh.n_owned]

    def _pieces(self):
        """Yield (slice, corners (n, corners, dim), m) of the local cells."""
        for first in range(0, len(self.mesh.cells), _PIECE):
            piece = slice(first, first + _PIECE)
            yield piece, self.mesh.points[self.mesh.cells[piece]]

    def _hold(self, any_here, name, key, what):
        if not self.comm.allreduce(int(any_here)):
            raise self.scene.error(key, f'"{name}", which selects no {what} of the mesh', f"a region that holds at least one {what}")


def _samples(kind):
    """Return (n, dim) reference points, evenly spread over a cell."""
    axis = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    dim = ELEMENTS[kind].dim
    points = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    return points[points.sum(axis=1) < 1.0] if ELEMENTS[kind].simplex else points


def make_loads(scene, sets, elasticity, nodes):
    """Return ([BodyForce], [PrescribedMotion]) of a scene on owned vertices. Collective.

    Raises
    ------
    SceneError, on every rank: a region without a cell, facet or vertex; two motions of one component of a vertex.
    """
    loads, motions = [], []
    held = np.zeros((nodes.n_owned, scene.dim), bool)
    for number, load in enumerate(scene.load):
        key, function = f"{section('load', number, load)}: region", time_function(load.time)
        if load.type in ("displacement", "velocity"):
            members = np.flatnonzero(sets.vertices(load.region, key))
            components = [axis for axis, value in enumerate(load.value) if value != "free"]
            if sets.comm.allreduce(int(held[np.ix_(members, components)].sum())):
                raise scene.error(key, f'"{load.region}", where another load prescribes the same component of a vertex', "regions without common vertices")
            held[np.ix_(members, components)] = True
            motions += _motions(load, components, function, members, sets, elasticity, nodes)
        else:
            forces = _nodal_forces(load, sets, elasticity, nodes, key)
            loaded = np.flatnonzero(forces.any(axis=1))
            loads.append(BodyForce(nodes.owned_slots[loaded], forces[loaded], function))
    return loads, motions


def _motions(load, components, function, members, sets, elasticity, nodes):
    """Return [PrescribedMotion] of the owned vertices `members`; slopes of a flat-top basis are held along facets between them too. Collective."""
    values = [load.value[axis] for axis in components]
    if elasticity.basis.functions == 1:
        return [PrescribedMotion(nodes.owned_slots[members], components, values, function, load.type)]
    from pdhpc.fem.supports import Given, prescribe_on_facets

    facets = sets.facets_between(members)
    given = np.zeros(sets.mesh.dim)
    given[components] = values
    motions = prescribe_on_facets(elasticity, nodes, facets, components, Given(given, function), load.type)
    rest = nodes.owned_slots[members][~np.isin(nodes.owned_slots[members], np.concatenate([motion.indices for motion in motions] or [[]]))]
    return motions + [PrescribedMotion(rest, components, values, function, load.type)]


def _nodal_forces(load, sets, elasticity, nodes, key):
    """Return (n_owned, width), N, of a load at f = 1. Collective."""
    value = np.asarray(load.value, float)
    if load.type == "traction":
        return traction_loads(elasticity, *sets.facets(load.region, load.face, key), value)
    shares = sets.shares(load.region, key)
    if load.type == "gravity":
        shares = shares * elasticity.density[elasticity.kind]
    return body_loads(elasticity, nodes.stars, shares[:, None] * value)


def set_initial_state(scene, sets, elasticity, nodes):
    """Set initial displacements and velocities of owned vertices: u = u0 + G (x - origin). Collective."""
    for number, initial in enumerate(scene.initial):
        members = np.flatnonzero(sets.vertices(initial.region, f"initial[{number}]: region"))
        slots = nodes.owned_slots[members]
        offset = sets.mesh.points[members] - np.asarray(initial.origin if initial.origin is not None else [0.0] * scene.dim)
        for target, constant, gradient in (
            (nodes.displacement, initial.displacement, initial.displacement_gradient),
            (nodes.velocity, initial.velocity, initial.velocity_gradient),
        ):
            matrix = np.zeros((scene.dim, scene.dim)) if gradient is None else np.asarray(gradient, float)
            values = offset @ matrix.T + (0.0 if constant is None else np.asarray(constant))
            gradients = np.broadcast_to(matrix, (len(members), scene.dim, scene.dim))
            target[slots] += elasticity.basis.interpolated(sets.mesh, values, gradients).reshape(len(members), -1)
