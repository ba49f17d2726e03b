"""The critical step of explicit integration, 2 / omega_max: a bound from single cells, and an estimate by power iteration."""
import math

import numpy as np

from pdhpc.parallel.comm import exact_sum, largest
from pdhpc.parallel.noise import noise

_PIECE = 4096  # cells whose eigenvalues are computed together


def bound_of_cells(body, stiffness):
    """Return 2 / omega of the stiffest cell, s, each with its own lumped mass: never above the critical step of the mesh. Collective over the mesh's ranks.

    omega_max^2 of the whole is at most the largest of the cells' (Irons and Treharne 1971; Fried 1972).

    body : Elasticity in hats. stiffness : CellMatrices.
    """
    mass, index = body.lumped_rows()
    pairs = np.unique(np.stack([stiffness.index, index]), axis=1) if len(index) else np.zeros((2, 0), int)
    most = 0.0
    for first in range(0, pairs.shape[1], _PIECE):
        k, m = pairs[:, first : first + _PIECE]
        root = 1.0 / np.sqrt(np.repeat(mass[m], body.mesh.dim, axis=1))
        scaled = root[:, :, None] * stiffness.matrices[k] * root[:, None, :]
        most = max(most, float(np.linalg.eigvalsh(scaled)[:, -1].max()))
    most = largest(body.mesh.comm, most)
    return 2.0 / math.sqrt(most) if most > 0.0 else math.inf


def estimate_step(nodes, forces, rounds=400, tolerance=1e-3):
    """Return (estimate, s, of 2 / omega_max by power iteration; relative change of the last ten rounds). Collective over the mesh's ranks.

    The estimate comes from above: take a few per cent less. It has the same bits on any number of ranks.

    nodes : Nodes with masses. forces : InternalForces on a field of its own, which is used up.
    """
    comm, mass = nodes.mesh.comm, nodes.owned(nodes.mass)[:, None]
    w, value, before, change = noise(nodes.mesh.vertex_id[: nodes.n_owned], nodes.dim), 0.0, 0.0, math.inf
    for number in range(rounds):
        nodes.put(forces.field, w)
        forces.evaluate()
        new = -nodes.owned(forces.force) / mass
        norm = math.sqrt(exact_sum(comm, (mass * w * w).sum(axis=1)))
        value = exact_sum(comm, (mass * w * new).sum(axis=1)) / norm**2
        if not value > 0.0:
            return math.inf, 0.0
        if number % 10 == 9:
            before, change = value, abs(value - before) / value
            if change < 2 * tolerance / 10:
                break
        w = new / (norm * value)
    return 2.0 / math.sqrt(value), change


def critical_step(body, stiffness, nodes, forces):
    """Return a step, s, that is not above the critical one: the better of the bound by cells and 98 % of the estimate. Collective over the mesh's ranks.

    body : Elasticity in hats. stiffness : CellMatrices. nodes, forces : as estimate_step.
    """
    bound = bound_of_cells(body, stiffness)
    estimate, change = estimate_step(nodes, forces)
    return max(bound, 0.98 * estimate) if change < 1e-3 else bound
