"""Scene -> the mesh of its bodies, and what tells its cells apart."""
from pathlib import Path
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.fem.mesh import Mesh, cell_partition, make_box_mesh, read_mesh
from pdhpc.fem.moduli import isotropic
from pdhpc.parallel.comm import agree_on_error
from pdhpc.parallel.partition import Partition
from pdhpc.scene.body import make_shape
from pdhpc.scene.schema import POISSONS_RATIO
from pdhpc.scene.sections import section
from pdhpc.scene.sentences import nearest

_MOST_CELLS = 2**28  # of a rank, whose vertices and slots are numbered by 32 bits
_LOCKING = 0.499  # Poisson's ratio from which on a run is warned of locking
_WEIGHT = 16  # of a cell in the partition of a box; one that is left out counts as 1


class MeshBody(NamedTuple):
    """The bodies of a scene as cells.

    mesh. number (n_cells,) int32 : the body of each local cell. kind (n_cells,) int32 : its material. partition : of a box, None of a file.
    """

    mesh: Mesh
    number: np.ndarray
    kind: np.ndarray
    partition: Optional[Partition]


def make_mesh_body(scene, comm):
    """Return the MeshBody of a scene. Collective.

    Raises
    ------
    SceneError, on every rank: no cell is left, or too many; a file that cannot be read, holds another dimension, or lacks a group; cells in no body, or in two.
    """
    mesh, number, partition = (_read if scene.from_file else _fill)(scene, comm)
    names = [material.name for material in scene.material]
    material = np.array([names.index(body.material) for body in scene.body], np.int32)
    return MeshBody(mesh, number, material[number], partition)


def box_of(scene):
    """Return (lower, upper, counts) of the box of cells around all bodies. Local."""
    lower = np.min([body.lower for body in scene.body], axis=0).astype(float)
    upper = np.max([body.upper for body in scene.body], axis=0).astype(float)
    return lower, upper, np.maximum(1, np.rint((upper - lower) / scene.mesh.cell_size)).astype(np.int64)


def body_of_cells(scene, centres):
    """Return (n,) int32: the body of cells of a box by their centres (n, dim), m, -1 where there is none. Local."""
    number = np.full(len(centres), -1, np.int32)
    for place, body in enumerate(scene.body):
        inside = make_shape(body).contains(centres)
        for hole in body.hole:
            inside &= ~make_shape(hole).contains(centres)
        number[inside] = place
    return number


def _fill(scene, comm):
    """Return (Mesh, body of each local cell, Partition) of boxes. Collective."""
    lower, upper, counts = box_of(scene)
    most = _MOST_CELLS * comm.size
    if np.prod(counts, dtype=float) > most:
        raise scene.error("mesh.cell_size", f"{scene.mesh.cell_size:g} m, which makes {np.prod(counts, dtype=float):.3g} cells", f"at most {most:.3g} on {comm.size} ranks")
    whole = len(scene.body) == 1 and not scene.body[0].hole

    def keep(centres):
        return body_of_cells(scene, centres) >= 0

    def weight(centres):
        return np.where(keep(centres), _WEIGHT, 1)

    partition = cell_partition(comm, lower, upper, counts, None if whole else weight)
    try:
        mesh = make_box_mesh(comm, lower, upper, counts, partition, None if whole else keep)
    except ValueError as error:
        raise scene.error("body", str(error), "bodies that are not wholly a hole") from error
    number = np.zeros(len(mesh.cells), np.int32) if whole else body_of_cells(scene, mesh.points[mesh.cells].mean(axis=1))
    return mesh, number, partition


def _read(scene, comm):
    """Return (Mesh, body of each local cell, None) of a file. Collective."""
    path = Path(scene.source).parent / scene.mesh.file
    try:
        mesh = read_mesh(comm, path)
    except ValueError as error:
        allowed = "a file of one kind of cells that meshio reads, named from the folder of the scene"
        raise scene.error("mesh.file", f'"{scene.mesh.file}" ({error})', allowed) from error
    if mesh.dim != scene.dim:
        raise scene.error("mesh.file", f'"{scene.mesh.file}" with cells of {mesh.dim} dimensions', f'cells of {scene.dim} with dimension = "{scene.dimension}"')
    number = np.full(len(mesh.cells), -1, np.int32)
    for place, body in enumerate(scene.body):
        key = f"{section('body', place, body)}: group"
        inside = np.ones(len(mesh.cells), bool) if body.group is None else cells_of_group(scene, comm, mesh, body.group, key)
        twice = comm.allreduce(int(np.count_nonzero(inside[: mesh.n_owned_cells] & (number[: mesh.n_owned_cells] >= 0))))
        if twice:
            raise scene.error(key, f'"{body.group}", which shares {twice} cells with a body before it', "groups without common cells")
        number[inside] = place
    left = comm.allreduce(int(np.count_nonzero(number[: mesh.n_owned_cells] < 0)))
    if left:
        raise scene.error("body", f"{left} of {mesh.n_global_cells} cells of {scene.mesh.file} in no body", "bodies whose groups hold all cells")
    return mesh, number, None


def cells_of_group(scene, comm, mesh, name, key):
    """Return (n_cells,) bool, the local cells of a physical group of cells; `key` names it in an error. Collective."""
    known = sorted(set().union(*comm.allgather(set(mesh.regions))))
    if name not in known:
        raise scene.error(key, f'"{name}"', f"a group of cells of {scene.mesh.file} ({', '.join(known) or 'it has none'}){nearest(name, known)}")
    return mesh.regions.get(name, np.zeros(len(mesh.cells), bool))


def moduli_of(scene):
    """Return (moduli (n_material, v, v), Pa; density (n_material,), kg/m^3) of Hooke's law. Local."""
    moduli = [isotropic(*_elastic_constants(scene, table), scene.dimension) for table in scene.material]
    return np.array(moduli), np.array([table.density for table in scene.material])


def _elastic_constants(scene, table):
    """Return (E, Pa, nu) of a material table. Local."""
    if table.model == "pmb":
        return table.youngs_modulus, POISSONS_RATIO[scene.dimension]
    if table.youngs_modulus is not None:
        return table.youngs_modulus, table.poissons_ratio
    k, g = table.bulk_modulus, table.shear_modulus
    return 9 * k * g / (3 * k + g), (3 * k - 2 * g) / (2 * (3 * k + g))


def locking(scene):
    """Return a sentence for each material that is too near to incompressible for elements of linear functions. Local."""
    if scene.dimension == "plane_stress":
        return []
    ratios = {table.name: _elastic_constants(scene, table)[1] for table in scene.material}
    return [f"the elements of material '{name}' lock at Poisson's ratio {nu:.6g}: they move too little, and a static solve stalls, the more the nearer it is to 1/2"
            for name, nu in ratios.items() if nu > _LOCKING]


def checked_locally(scene, comm, action, *arguments):
    """Return action(*arguments), local work on the mesh; a ValueError of any rank becomes a SceneError on every rank. Collective."""
    with agree_on_error(comm):
        try:
            return action(*arguments)
        except ValueError as error:
            raise scene.error("mesh.file" if scene.from_file else "mesh.cell_size", str(error), "cells that are not degenerate") from error
