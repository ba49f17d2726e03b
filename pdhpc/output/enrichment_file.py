"""The enriched space at the end of a run, enrichment.h5: patches, who is enriched by what, and the pattern of the mass matrix.

    vertices/   id, position (n, dim) m, displacement (n, dim) m, patch (1 in J), enriched (n, dim) by component, residual (n, dim) of patches
    cells/      vertex (n, corners), ids in VTK order; patch: 0, 1 with a vertex in J, 2 with all of them
    raster/     over enriched cells, finer than the particles: position (n, dim) m, displacement u (n, dim) m, functions (n, m), values of some phi_i u_c, m
    functions/  vertex (id of i) and component c of these
    unknowns/   of the mass matrix on enriched cells: number, component, enriched (1 or 0), vertex;   entries/  row, column of what is not 0

Attributes: step, time, scheme, spacing of particles, pixel of the raster, tolerance. Rows stand in rank order: compare by id, number, position.
Scheme "pinned" has neither residuals nor functions nor a mass matrix.
"""
from pathlib import Path

import numpy as np

from pdhpc.output.record import OutputError
from pdhpc.parallel.comm import on_root

NAME = "enrichment.h5"


def write_enrichment(comm, directory, data, attributes):
    """Write {name: (n, ...) rows of this rank} and attributes to enrichment.h5, complete or not at all; one rank after the other. Collective.

    Raises
    ------
    OutputError: it cannot be written; on every rank.
    """
    path = Path(directory) / NAME
    part = path.with_name(NAME + ".part")
    counts = comm.allgather({name: len(values) for name, values in data.items()})
    error = None
    for rank in range(comm.size):
        if rank == comm.rank:
            error = _write(part, data, counts, rank, attributes)
        comm.Barrier()
    errors = [each for each in comm.allgather(error) if each is not None]
    if errors:
        raise OutputError(f"{path}: cannot be written ({errors[0]})")
    on_root(comm, part.replace, path)


def _write(part, data, counts, rank, attributes):
    """Write the rows of a rank; return what went wrong, or None."""
    import h5py

    try:
        with h5py.File(part, "w" if rank == 0 else "r+") as file:
            for name, values in data.items():
                if rank == 0:
                    file.create_dataset(name, shape=(sum(each[name] for each in counts),) + values.shape[1:], dtype=values.dtype)
                first = sum(each[name] for each in counts[:rank])
                file[name][first : first + len(values)] = values
            if rank == 0:
                file.attrs.update(attributes)
    except (OSError, RuntimeError, KeyError) as caught:
        return str(caught).splitlines()[0]
    return None


def read_enrichment(directory):
    """Return ({name: array}, attributes) of a run's enrichment.h5. Local."""
    import h5py

    data = {}
    with h5py.File(Path(directory) / NAME, "r") as file:
        file.visititems(lambda name, item: data.update({name: item[:]}) if isinstance(item, h5py.Dataset) else None)
        attributes = {name: value.item() if isinstance(value, np.generic) else value for name, value in file.attrs.items()}
    return data, attributes
