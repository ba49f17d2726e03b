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

from pdhpc.output.rows_file import write_file

NAME = "enrichment.h5"


def write_enrichment(comm, directory, data, attributes):
    """Write {name: (n, ...) rows of this rank} and attributes to enrichment.h5, complete or not at all. Collective.

    Raises
    ------
    OutputError: it cannot be written; on every rank.
    """
    write_file(comm, Path(directory) / NAME, data, attributes)


def read_enrichment(directory):
    """Return ({name: array}, attributes) of a run's enrichment.h5. Local."""
    import h5py

    data = {}
    with h5py.File(Path(directory) / NAME, "r") as file:
        file.visititems(lambda name, item: data.update({name: item[:]}) if isinstance(item, h5py.Dataset) else None)
        attributes = {name: value.item() if isinstance(value, np.generic) else value for name, value in file.attrs.items()}
    return data, attributes
