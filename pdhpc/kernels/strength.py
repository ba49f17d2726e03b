"""Strengths that scatter: of particles by their ids, or of grains by their places alone, so that all ranks, on any number of them, agree without a message."""
import math

import numpy as np

from pdhpc.jit import inlined, kernel


@kernel
def scatter_strengths(ids, places, slots, block, failure, strength):
    """Store f = scale (-ln U)^(1/modulus) of each particle in strength (n_slots,), 1; see materials/failure.py, ScatteredLimit.

    ids (n,) int64, global ids; places (n, dim), m, in the unloaded body; slots (n,), of these particles; block (n_slots,) uint8.
    One logarithm and one power at a time: vectors of them may round otherwise.
    """
    for n in range(len(ids)):
        kind = block[slots[n]]
        if math.isinf(failure.modulus[kind]):
            strength[slots[n]] = 1.0
            continue
        number = mixed(failure.seed[kind]) + np.uint64(ids[n])
        if failure.grain[kind] > 0.0:
            number = _grain_at(places[n], failure.grain[kind], failure.seed[kind])
        strength[slots[n]] = failure.scale[kind] * math.pow(-math.log(uniform(number)), 1.0 / failure.modulus[kind])


@kernel
def _grain_at(place, size, seed):
    """Return the number of the grain at a place: of the nearest among points that lie at random, one in each square or cube of a grid of sides `size`.

    The points of the grid's cell at the place and of those around it are looked at: one further away is the nearest of less than one place in 100,000,
    whose grain is then another one of its neighbours.
    """
    dim, found, nearest = len(place), np.uint64(0), np.inf
    for around in range(3**dim):
        number, distance2, rest = mixed(seed), 0.0, around
        for axis in range(dim):
            number = mixed(number + np.uint64(np.int64(math.floor(place[axis] / size)) + rest % 3 - 1))
            rest //= 3
        rest = around
        for axis in range(dim):
            offset = math.floor(place[axis] / size) + rest % 3 - 1 + uniform(number + np.uint64(1 + axis)) - place[axis] / size
            distance2 += offset * offset
            rest //= 3
        if distance2 < nearest:
            found, nearest = number, distance2
    return found


@inlined
def uniform(number):
    """Return a number in (0, 1) that depends on a uint64 alone."""
    return (np.float64(mixed(number) >> np.uint64(12)) + 0.5) / 4503599627370496.0


@inlined
def mixed(number):
    """Return a uint64 every bit of which depends on every bit of another: a step of SplitMix64 (Steele, Lea & Flood 2014)."""
    number = number + np.uint64(0x9E3779B97F4A7C15)
    number = (number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    number = (number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return number ^ (number >> np.uint64(31))
