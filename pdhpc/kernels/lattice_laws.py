"""What sweeps over a lattice ask of a law, eight particles at a time: of one block, whose numbers are constants, or of several, looked up lane by lane."""
from typing import NamedTuple

import numpy as np

from pdhpc.jit import implements
from pdhpc.kernels.simd import load8, lookup8, pick8
from pdhpc.materials.bond_based import BondBasedLaw
from pdhpc.materials.law import moduli
from pdhpc.materials.state_based import LinearSolidLaw


class OneBlock(NamedTuple):
    """Eight particles which, with their neighbours, are of one block."""

    kind: int


class SeveralBlocks(NamedTuple):
    """Eight particles which, with their neighbours, are of several blocks."""

    unused: int


def per_block(which, table, points, i):
    """Return the entries of a table (n_block,) for eight particles."""


def near_end_of(law, which, points, state, i, j):
    """Return the law's near ends of one bond of eight particles, j the slot of the first's neighbour."""


def far_end_of(law, state, j):
    """Return the law's far ends of one bond of eight particles."""


def bound_of(law, which, points, i):
    """Return the factor of the law's `stiffness` of eight particles."""


def spherical_of(law, which, points, i):
    """Return what the law's `volume_energy` needs of the blocks of eight particles."""


@implements(per_block, OneBlock)
def _per_one_block(which, table, points, i):
    return table[which.kind]


@implements(per_block, SeveralBlocks)
def _per_several_blocks(which, table, points, i):
    return pick8(table, points.block, i)


def modulus_of(which, law, points, i, j):
    """Return the micromoduli of one bond of eight particles."""


@implements(modulus_of, OneBlock)
def _modulus_of_one_block(which, law, points, i, j):
    return law.micromodulus[which.kind, which.kind]


@implements(modulus_of, SeveralBlocks)
def _modulus_of_several_blocks(which, law, points, i, j):
    return lookup8(law.micromodulus, points.block, i, points.block, j)


@implements(near_end_of, BondBasedLaw)
def _near_end_of_bond_based(law, which, points, state, i, j):
    return modulus_of(which, law, points, i, j)


@implements(far_end_of, BondBasedLaw)
def _far_end_of_bond_based(law, state, j):
    return 0.0


@implements(bound_of, BondBasedLaw)
def _bound_of_bond_based(law, which, points, i):
    return 1.0


@implements(spherical_of, BondBasedLaw)
def _spherical_of_bond_based(law, which, points, i):
    return 0.0


@implements(near_end_of, LinearSolidLaw)
def _near_end_of_linear_solid(law, which, points, state, i, j):
    return load8(state, i), load8(state, len(state) + i)


@implements(far_end_of, LinearSolidLaw)
def _far_end_of_linear_solid(law, state, j):
    return load8(state, j), load8(state, len(state) + j)


@implements(bound_of, LinearSolidLaw)
def _bound_of_linear_solid(law, which, points, i):
    return per_block(which, law.bound, points, i)


@implements(spherical_of, LinearSolidLaw)
def _spherical_of_linear_solid(law, which, points, i):
    return per_block(which, law.spherical, points, i)


class Weighted(NamedTuple):
    """Eight particles whose bonds share a modulus, which the weights hold."""

    one: float


class TableOfModuli(NamedTuple):
    """Eight particles whose bonds have the micromoduli of a table by block."""

    micromodulus: np.ndarray


class States(NamedTuple):
    """(a, p) of eight particles of a state-based law, vectors."""

    a: object
    p: object


def uniform_ends(law, state, i):
    """Return what the law needs of eight particles which, with their neighbours, are of one block."""


def mixed_ends(law, state, i):
    """Return what the law needs of eight particles which, with their neighbours, are of several blocks."""


def bond_moduli(near, law, points, state, i, j):
    """Return the law's `moduli` for one bond of eight particles; j is the slot of the first's neighbour. The weights may hold some."""


@implements(uniform_ends, BondBasedLaw)
def _weighted(law, state, i):
    return Weighted(1.0)


@implements(mixed_ends, BondBasedLaw)
def _table_of_moduli(law, state, i):
    return TableOfModuli(law.micromodulus)


@implements(uniform_ends, LinearSolidLaw)
def _uniform_states(law, state, i):
    return States(load8(state, i), load8(state, len(state) + i))


@implements(mixed_ends, LinearSolidLaw)
def _mixed_states(law, state, i):
    return States(load8(state, i), load8(state, len(state) + i))


@implements(bond_moduli, Weighted)
def _moduli_weighted(near, law, points, state, i, j):
    return 1.0, 0.0


@implements(bond_moduli, TableOfModuli)
def _moduli_of_table(near, law, points, state, i, j):
    return moduli(law, lookup8(near.micromodulus, points.block, i, points.block, j), 0.0)


@implements(bond_moduli, States)
def _moduli_of_states(near, law, points, state, i, j):
    return moduli(law, (near.a, near.p), (load8(state, j), load8(state, len(state) + j)))
