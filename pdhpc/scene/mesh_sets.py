"""Scene -> the cells, facets and vertices of its regions, and the loads, motions and initial states that act on them."""
import numpy as np

from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.fem.loads import body_loads, body_loads_within, facets_of_set, facets_where, traction_loads, vertices_of
from pdhpc.parallel.comm import exact_sum
from pdhpc.scene.body import make_shape
from pdhpc.scene.conditions import time_function
from pdhpc.scene.sections import section
from pdhpc.scene.sentences import nearest

_PIECE = 1 << 14  # cells looked at together: bounds the temporary memory
_NUDGE = 1e-6  # of the way to the middle of a cell: on which side of a region's boundary something lies is asked a little inside of the cell
_ALIGNED = 0.99  # cosine of the angle between a facet's normal and a face from which on the facet counts as part of it


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

    def cells(self, name, key):
        """Return (marks (n_cells,) bool, shape or None): local cells of a region's group or body, all of them or what of each lies in the shape."""
        region = self._region(name)
        if region is None:
            return np.ones(len(self.mesh.cells), bool), None
        if region.shape != "group":
            return self._in_body(region), make_shape(region)
        if region.group not in self._of_cells:
            allowed = f"a region of cells: {self.scene.mesh.file} has {', '.join(self._of_cells) or 'no groups of them'}"
            raise self.scene.error(key, f'"{name}", whose group "{region.group}" is one of facets', allowed)
        return self._cells(region.group), None

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
        self.hold(found.any(), name, key, "vertex")
        return found

    def facets(self, name, face, key):
        """Return (facets, cell, shape or None): facets on the surface, as fem.loads.facets_where, with the outward normal `face` ("+x", ...; None: any).

        They are those of a region's group, or all of its body, of which a load takes what lies in the shape.
        """
        region, mesh = self._region(name), self.mesh
        direction = np.zeros(mesh.dim)
        if face is not None:
            direction["xyz".index(face[1])] = 1.0 if face[0] == "+" else -1.0
        facets, cell = facets_where(mesh, lambda centres, normals: np.full(len(centres), face is None) | (normals @ direction > _ALIGNED))
        if region is None:
            return facets, cell, None
        keep = self._in_body(region)[cell] if region.shape != "group" else self._in_group(region.group, facets, cell)
        return facets[keep], cell[keep], make_shape(region) if region.shape != "group" else None

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

    def hold(self, any_here, name, key, what):
        """Raise a SceneError of a region that selects no `what` on any rank."""
        if not self.comm.allreduce(int(any_here)):
            raise self.scene.error(key, f'"{name}", which selects no {what} of the mesh', f"a region that holds at least one {what}, or a part of it")


def make_loads(scene, sets, elasticity, nodes):
    """Return ([BodyForce], [PrescribedMotion], [dict]) of a scene on owned vertices; the dicts say in run.json what the forces are in all. Collective.

    Raises
    ------
    SceneError, on every rank: a region without a cell, facet or vertex; two motions of one component of a vertex.
    """
    loads, motions, records = [], [], []
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
            forces, measure = (_tractions if load.type == "traction" else _body_forces)(load, sets, elasticity, nodes, key)
            loaded = np.flatnonzero(forces.any(axis=1))
            loads.append(BodyForce(nodes.owned_slots[loaded], forces[loaded], function))
            resultant = [exact_sum(sets.comm, forces[:, axis]) for axis in range(scene.dim)]
            records.append({"name": load.name or number, "type": load.type, "resultant": resultant, **measure})
    return loads, motions, records


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


def _tractions(load, sets, elasticity, nodes, key):
    """Return ((n_owned, width), N, of a traction at f = 1, {"area": m^2 that it acts on}). Collective."""
    on = sets.facets(load.region, load.face, key)
    one = traction_loads(elasticity, on[0], on[1], np.eye(sets.mesh.dim)[0], on[2])
    sets.hold(one.any(), load.region, key, "facet" if load.face is None else f"facet with the outward normal {load.face}")
    return traction_loads(elasticity, on[0], on[1], np.asarray(load.value, float), on[2]), {"area": exact_sum(sets.comm, one[:, 0])}


def _body_forces(load, sets, elasticity, nodes, key):
    """Return ((n_owned, width), N, of a force density or of gravity at f = 1, {"volume": m^3 that it acts on}). Collective."""
    marks, shape = sets.cells(load.region, key)

    def integrated(density):
        return body_loads(elasticity, nodes.stars, density) if shape is None else body_loads_within(elasticity, nodes.stars, density, shape)

    one = integrated(marks[:, None] * np.eye(sets.mesh.dim)[0])
    sets.hold(one.any(), load.region, key, "cell")
    scale = marks * (elasticity.density[elasticity.kind] if load.type == "gravity" else 1.0)
    return integrated(scale[:, None] * np.asarray(load.value, float)), {"volume": exact_sum(sets.comm, one[:, 0])}


def set_initial_state(scene, sets, elasticity, nodes):
    """Set initial displacements and velocities of owned vertices: u = u0 + G (x - origin), and what the velocity has about an axis. Collective."""
    for number, initial in enumerate(scene.initial):
        members = np.flatnonzero(sets.vertices(initial.region, f"initial[{number}]: region"))
        slots, places, about_axis = nodes.owned_slots[members], sets.mesh.points[members], initial.about_axis(scene.dim)
        offset = places - np.asarray(initial.origin if initial.origin is not None else [0.0] * scene.dim)
        for target, constant, gradient in (
            (nodes.displacement, initial.displacement, initial.displacement_gradient),
            (nodes.velocity, initial.velocity, initial.velocity_gradient),
        ):
            matrix = np.zeros((scene.dim, scene.dim)) if gradient is None else np.asarray(gradient, float)
            values = offset @ matrix.T + (0.0 if constant is None else np.asarray(constant))
            gradients = np.broadcast_to(matrix, (len(members), scene.dim, scene.dim))
            target[slots] += elasticity.basis.interpolated(sets.mesh, values, gradients).reshape(target[slots].shape)
        if about_axis is not None:
            unknowns = elasticity.basis.interpolated(sets.mesh, about_axis.velocity(places), about_axis.gradient(places))
            nodes.velocity[slots] += unknowns.reshape(nodes.velocity[slots].shape)
