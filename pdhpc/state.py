"""What a continued run needs: whoever owns state registers it as entries by key, {key: Entry}."""
from typing import Any, Callable, NamedTuple

import numpy as np

EVERYWHERE = "everywhere"
"""One value that every rank has."""
SUM = "sum"
"""A number, or rows, of each rank of which the sum over all alone matters."""


class Entry(NamedTuple):
    """One piece of a run's state.

    get : () -> a number or an array. set : (value), of the shape of what get() returns here, but for the columns of bond states.
    of : (n,) int64, the global ids of the points whose rows these are; or EVERYWHERE, or SUM.
    """

    get: Callable[[], Any]
    set: Callable[[Any], None]
    of: Any


def number(owner, name, kind=float, of=EVERYWHERE):
    """Return the Entry of an attribute that is a number."""
    return Entry(lambda: getattr(owner, name), lambda value: setattr(owner, name, kind(value)), of)


def item(values, key, kind=float):
    """Return the Entry of a number in a dict that every rank has."""
    return Entry(lambda: values[key], lambda value: values.update({key: kind(value)}), EVERYWHERE)


def rows(values, ids):
    """Return the Entry of an array (n, ...) that stays where it is; ids (n,) of its rows."""
    return Entry(lambda: values, lambda given: np.copyto(values, given), ids)


def whole(values):
    """Return the Entry of an array that stays where it is and that every rank has."""
    return rows(values, EVERYWHERE)
