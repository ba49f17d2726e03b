"""What a coupled body looks like at the end of a run, as arrays: its patches, the field that particles show in them, and the space that this field enriches.

The space is span{phi_i, phi_j u_c}, u the displacement: vertices j, by component c, as the scheme would choose them for u itself. Those that it chooses for the
increment of a step, in whose space it solves, are counted in history.csv.
"""
import numpy as np

from pdhpc.gfem.enrichment import EnrichedSpace
from pdhpc.gfem.raster import rebuild

_FUNCTIONS = 3  # shown: those with the largest patch residuals, one of each component at least


def displayed(comm, stepper):
    """Return ({name: rows of this rank}, {name: number or word}), as output/enrichment_file.py stores them. Collective.

    "pinned" has no functions that are enriched one by one, and so neither residuals nor functions nor a mass matrix to show.
    """
    mesh, patches, scheme = stepper.solution.mesh, stepper.patches, stepper.scheme
    raster = rebuild(comm, stepper)
    data = {**_patches(stepper), "raster/position": raster.position, "raster/displacement": raster.displacement.astype(np.float32)}
    attributes = {"step": stepper.step, "time": stepper.time, "scheme": scheme.name, "spacing": stepper.local.lattice.spacing, "pixel": raster.pixel}
    if not hasattr(scheme, "tolerance"):
        return data, attributes
    space, owned = _space_of_displacements(stepper), slice(mesh.n_owned)
    data["vertices/enriched"] = space.selected[owned].astype(np.int8)
    data["vertices/residual"] = np.where(patches.chosen[owned, None], space.residual[owned], 0.0)
    shown = _largest(comm, data["vertices/id"], np.where(data["vertices/enriched"], data["vertices/residual"], -1.0))
    ids = mesh.vertex_id[raster.corner]
    functions = [(raster.shape * (ids == vertex)).sum(axis=1) * raster.displacement[:, component] for vertex, component in shown]
    data["raster/functions"] = np.stack(functions, axis=1).astype(np.float32) if functions else np.empty((len(ids), 0), np.float32)
    data["functions/vertex"], data["functions/component"] = (np.array([each[k] for each in shown if comm.rank == 0], np.int64) for k in (0, 1))
    return {**data, **_pattern(space, mesh.vertex_id)}, {**attributes, "tolerance": scheme.tolerance}


def _patches(stepper):
    """Return the vertices and cells of this rank, and which of them are enriched. Local."""
    solution, patches = stepper.solution, stepper.patches
    mesh, owned, own_cells = solution.mesh, slice(solution.mesh.n_owned), slice(solution.mesh.n_owned_cells)
    chosen = patches.chosen[owned]
    return {
        "vertices/id": mesh.vertex_id[owned],
        "vertices/position": mesh.points[owned],
        "vertices/displacement": solution.displacement[owned],
        "vertices/patch": chosen.astype(np.int8),
        "vertices/enriched": np.repeat(chosen[:, None], mesh.dim, axis=1).astype(np.int8),
        "cells/vertex": mesh.vertex_id[mesh.cells[own_cells]],
        "cells/patch": patches.enriched[own_cells].astype(np.int8) + patches.whole[own_cells],
    }


def _space_of_displacements(stepper):
    """Return the EnrichedSpace of the displacement of all points. Collective."""
    local, space = stepper.local, EnrichedSpace(stepper.solution.mesh)
    space.update(stepper.patches.chosen, local.points, stepper.solution.outside_mass)
    space.select(np.ascontiguousarray(local.subdomain.particles.position[local.points.slots]), stepper.scheme.tolerance)
    return space


def _largest(comm, ids, residual):
    """Return [(vertex id, component)] with the largest of residual (n, dim) at vertices ids (n,), by component; those below 0 do not count. Collective."""
    found = []
    for component in range(residual.shape[1]):
        order = np.lexsort((ids, -residual[:, component]))[:_FUNCTIONS]
        mine = [(-float(residual[k, component]), int(ids[k]), component) for k in order if residual[k, component] >= 0.0]
        found.append(sorted(sum(comm.allgather(mine), [])))
    first = [each for ranked in found for each in ranked[:1]]
    others = sorted(each for ranked in found for each in ranked[1:])
    chosen = first + others[: max(0, _FUNCTIONS - len(first))]
    return [(vertex, component) for _, vertex, component in sorted(chosen, key=lambda each: (each[2], each[0], each[1]))]


def _pattern(space, vertex_id):
    """Return the unknowns of this rank (global number, component, 1 for an enriched function, vertex id) and the rows and columns of what is not 0. Local."""
    mass, dim = space.mass, space.mass.dim
    vertices = np.concatenate((mass.standard, mass.enriched))
    enriched = np.repeat(np.repeat([0, 1], [len(mass.standard), len(mass.enriched)]), dim)
    component = np.tile(np.arange(dim), len(vertices))
    vertex = np.repeat(vertices, dim)
    number = mass.first + np.arange(mass.n_local)
    there = (enriched == 0) | space.selected[vertex, component]
    row = np.repeat(np.arange(mass.n_local), np.diff(mass.indptr))
    filled = (mass.values != 0.0) & there[row]
    unknowns = {"number": number, "component": component, "enriched": enriched, "vertex": vertex_id[vertex]}
    pattern = {f"unknowns/{name}": values[there] for name, values in unknowns.items()}
    return {**pattern, "entries/row": number[row[filled]], "entries/column": mass.columns[filled]}
