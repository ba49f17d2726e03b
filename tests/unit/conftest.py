"""What tests of many modules look at: the bonds of a subdomain, whichever way they are stored."""
import numpy as np
import pytest


def _intact_pairs(subdomain):
    """Return {(i, j)}, owned rows of the ends of every intact directed bond of a body that one process holds."""
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    if not hasattr(arrays, "offset"):
        bits = np.unpackbits(arrays.alive, bitorder="little").astype(bool)
        rows = np.repeat(np.arange(particles.n_owned), np.diff(arrays.row_start))
        return set(zip(rows[bits].tolist(), arrays.neighbour[bits].tolist()))
    row_of, found = np.full(len(particles.position), -1), set()
    row_of[particles.slots] = np.arange(particles.n_owned)
    for k, offset in enumerate(arrays.offset):
        bits = arrays.alive[k // 64, particles.slots] >> np.uint64(k % 64) & np.uint64(1)
        rows = np.flatnonzero(bits)
        found.update(zip(rows.tolist(), row_of[particles.slots[rows] + offset].tolist()))
    return found


def _lose_bonds(subdomain, row):
    """Break all bonds of an owned particle, at its end only."""
    arrays = subdomain.bonds.arrays
    if hasattr(arrays, "offset"):
        arrays.alive[:, subdomain.particles.slots[row]] = 0
    else:
        arrays.alive[arrays.row_start[row] >> 3 : arrays.row_start[row + 1] >> 3] = 0


@pytest.fixture
def intact_pairs():
    """Function subdomain -> {(i, j)} of intact directed bonds, by owned row."""
    return _intact_pairs


@pytest.fixture
def lose_bonds():
    """Function (subdomain, row) that breaks all bonds of an owned particle, at its end only."""
    return _lose_bonds
