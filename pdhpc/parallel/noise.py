"""Numbers that look random and depend on ids alone: the same on any number of ranks."""
import numpy as np


def noise(ids, dim, seed=0):
    """Return (n, dim) numbers in [-1, 1] that depend on the ids (n,) alone."""
    number = (np.asarray(ids, np.uint64)[:, None] * np.uint64(2 * dim) + np.arange(dim, dtype=np.uint64) + np.uint64(97 * seed + 1)) * np.uint64(0x9E3779B97F4A7C15)
    number ^= number >> np.uint64(29)
    number *= np.uint64(0xBF58476D1CE4E5B9)
    return (number >> np.uint64(11)).astype(float) / 2.0**52 - 1.0
