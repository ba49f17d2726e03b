"""Sweeps over bond states."""
import numpy as np

from pdhpc.jit import kernel

_BITS = np.array([bin(byte).count("1") for byte in range(256)], dtype=np.uint8)


@kernel
def count_alive(bonds, counts):
    """Store the number of intact bonds of each owned particle in counts (n_owned,) int32; rows fill whole bytes."""
    for i in range(len(counts)):
        total = 0
        for byte in range(bonds.row_start[i] >> 3, bonds.row_start[i + 1] >> 3):
            total += _BITS[bonds.alive[byte]]
        counts[i] = total


@kernel
def foremost_damaged(bonds, initial_size, threshold, members, ahead):
    """Return the member (owned index) whose damage 1 - intact/initial exceeds `threshold` with the largest ahead (n_owned,), m; -1 if none."""
    best, best_ahead = -1, -np.inf
    for m in range(len(members)):
        i = members[m]
        if ahead[i] <= best_ahead:
            continue
        total = 0
        for byte in range(bonds.row_start[i] >> 3, bonds.row_start[i + 1] >> 3):
            total += _BITS[bonds.alive[byte]]
        if initial_size[i] > 0 and 1.0 - total / initial_size[i] > threshold:
            best, best_ahead = i, ahead[i]
    return best
