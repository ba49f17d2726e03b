"""Sums of floats that are exact whatever their order, in one message: integers on a grid that covers every size a force can have."""
import math

import numpy as np

from pdhpc.jit import inlined

_WIDTH = 32  # bits of a place
_LOWEST = -320  # exponent of the lowest place: what is below 2^-320 (5e-97) is dropped
_PLACES = 20  # up to 2^320 (2e96)


class ExactSums:
    """Sums over all ranks of values that ranks add one by one; each sum is exact, then rounded once, so the same bits come out on any number of ranks.

    A value is cut into places of 32 bits on one grid; 64-bit integers hold 2^31 values a place. 168 bytes a sum travel.

    Attributes
    ----------
    places : (n, 21) int64, see add_exactly.
    """

    def __init__(self, comm, n):
        self.comm, self.places = comm, np.zeros((n, _PLACES + 1), np.int64)

    def clear(self):
        """Start again from 0. Local."""
        self.places[:] = 0

    def totals(self):
        """Return the n sums as floats; NaN where a value was not finite, or beyond 2e96. Collective, one message."""
        from mpi4py import MPI

        self.comm.Allreduce(MPI.IN_PLACE, self.places, MPI.SUM)
        return [math.nan if row[_PLACES] else _rounded(row[:_PLACES]) for row in self.places.tolist()]


def _rounded(places):
    """Return the sum of places as a float, correctly rounded."""
    total = 0
    for place in reversed(places):
        total = (total << _WIDTH) + place
    return math.ldexp(float(total), _LOWEST)


@inlined
def add_exactly(places, value):
    """Add a value to places (21,) int64: place b counts multiples of 2^(32 b - 320), the last one counts values that do not fit."""
    mantissa, exponent = math.frexp(value)
    place = (exponent - 1 - _LOWEST) // _WIDTH
    if not abs(value) < np.inf or place >= _PLACES:
        places[_PLACES] += 1
        return
    rest = value
    while place >= 0 and rest != 0.0:
        count = np.trunc(math.ldexp(rest, -(_LOWEST + _WIDTH * place)))
        places[place] += np.int64(count)
        rest -= math.ldexp(count, _LOWEST + _WIDTH * place)
        place -= 1
