from types import SimpleNamespace

import numpy as np

from pdhpc.state import EVERYWHERE, SUM, item, number, rows, whole


def test_entries_get_and_set_what_they_name():
    owner, table, values, ids = SimpleNamespace(step=3, lost=0.5), {"iterations": 4}, np.zeros((2, 3)), np.array([7, 9])
    entries = number(owner, "step", int), number(owner, "lost", of=SUM), item(table, "iterations", int), rows(values, ids), whole(values[0])
    assert [entry.get() for entry in entries[:3]] == [3, 0.5, 4] and [entry.of for entry in entries[:3]] == [EVERYWHERE, SUM, EVERYWHERE]
    for entry, value in zip(entries, (np.int64(5), np.float64(1.5), np.int64(6), np.ones((2, 3)), np.full(3, 2.0))):
        entry.set(value)
    assert (owner.step, owner.lost, table["iterations"]) == (5, 1.5, 6) and type(owner.step) is int
    assert values.tolist() == [[2.0] * 3, [1.0] * 3] and entries[3].of is ids and entries[4].of == EVERYWHERE
