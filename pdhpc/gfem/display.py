"""What an enriched space looks like, as arrays: enriched vertices, the field, some of its functions, and the pattern of its mass matrix."""
import numpy as np

_FUNCTIONS = 2  # shown of each component: those with the largest patch residuals


def displayed(comm, stepper):
    """Return {name: rows of this rank} of the space of displacements of the last step, as output/enrichment_file.py stores them. Collective.

    Of "pinned", which has no functions of its own, the vertices alone.
    """
    solution, patches, scheme = stepper.solution, stepper.patches, stepper.scheme
    mesh, owned = solution.mesh, slice(solution.mesh.n_owned)
    chosen = patches.chosen[owned]
    data = {
        "vertices/id": mesh.vertex_id[owned],
        "vertices/position": mesh.points[owned],
        "vertices/displacement": solution.displacement[owned],
        "vertices/patch": chosen.astype(np.int8),
        "vertices/enriched": np.repeat(chosen[:, None], mesh.dim, axis=1).astype(np.int8),
    }
    if not hasattr(scheme, "enrich_displacements"):
        return data
    eta, space, points = scheme.enrich_displacements(), scheme.mass, stepper.local.points
    data["vertices/enriched"] = space.selected[owned].astype(np.int8)
    data["vertices/residual"] = np.where(chosen[:, None], space.residual[owned], 0.0)
    corners = mesh.cells[np.repeat(points.cell, np.diff(points.start))]
    shown = _largest(comm, data["vertices/id"], np.where(data["vertices/enriched"], data["vertices/residual"], -1.0))
    functions = [(points.shape * (mesh.vertex_id[corners] == vertex)).sum(axis=1) * eta[:, component] for vertex, component in shown]
    data["points/position"] = np.einsum("pa,pad->pd", points.shape, mesh.points[corners])
    data["points/eta"] = eta
    data["points/functions"] = np.stack(functions, axis=1) if functions else np.empty((len(eta), 0))
    data["functions/vertex"], data["functions/component"] = (np.array([each[k] for each in shown if comm.rank == 0], np.int64) for k in (0, 1))
    return {**data, **_pattern(space, mesh.vertex_id)}


def _largest(comm, ids, residual):
    """Return [(vertex id, component)] with the largest of residual (n, dim) at vertices ids (n,), by component; those below 0 do not count. Collective."""
    shown = []
    for component in range(residual.shape[1]):
        order = np.lexsort((ids, -residual[:, component]))[:_FUNCTIONS]
        mine = [(-float(residual[k, component]), int(ids[k])) for k in order if residual[k, component] >= 0.0]
        found = sorted(sum(comm.allgather(mine), []))[:_FUNCTIONS]
        shown += [(vertex, component) for _, vertex in found]
    return shown


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
