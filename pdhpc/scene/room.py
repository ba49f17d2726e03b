"""Whether a scene can fit into the memory of the machines that a job has, before anything is made of it."""
import os

from pdhpc.parallel.comm import total_of_nodes
from pdhpc.scene.rules import cells_of

_LEAST_BYTES = {2: 73, 3: 105}  # of a particle or a vertex, whatever the path and the law
_LEAST_FILLED = 0.05  # of the box around a body that is no box


def check_room(scene, comm):
    """Raise a SceneError when the least that a scene takes is more than the memory of all nodes of the job. Collective."""
    bodies = [each for each in scene.body if each.file is None] if not scene.from_file else []
    cells = sum(cells_of(each, scene.spacing_of(each)) * (1.0 if each.shape == "box" else _LEAST_FILLED) for each in bodies)
    needed, there = cells * _LEAST_BYTES[scene.dim], total_of_nodes(comm, _physical_memory)
    if there and needed > there:
        where = "particles.spacing" if scene.uses_lattice else "mesh.cell_size"
        found = f"{scene.pitch:g} m, which makes about {cells:.3g} particles or cells of at least {_size(needed)} in all"
        raise scene.error(where, found, f"what fits into the {_size(there)} of this job's nodes: a larger one, or more nodes")


def _physical_memory():
    """Return the bytes of this machine's memory, or 0 where nobody says."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return 0


def _size(number):
    return f"{number / 1e9:.3g} GB"
