"""Connected sets of particles: those joined by intact bonds, by union and find with halved paths (Tarjan & van Leeuwen 1984)."""
from pdhpc.jit import inlined, sweep
from pdhpc.kernels.family import end_of_bonds, first_bond, is_alive, neighbour


@sweep
def join_intact(bonds, slots, label, parent, touches):
    """Give all owned particles that intact bonds join one root, and mark those with an intact bond to a ghost.

    slots (n,) int32, owned. label (n_slots,) int64, negative for particles whose bonds do not count, ghosts' fresh. parent (n_slots,) int32, each owned slot
    itself, -1 elsewhere; at the end the lowest slot of its set. touches (n,) bool.
    """
    for n in range(len(slots)):
        i = slots[n]
        touches[n] = False
        if label[i] < 0:
            continue
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            if is_alive(bonds, i, k):
                j = neighbour(bonds, i, k)
                if label[j] < 0:
                    continue
                if parent[j] < 0:
                    touches[n] = True
                    continue
                a, b = _root(parent, i), _root(parent, j)
                if a < b:
                    parent[b] = a
                elif b < a:
                    parent[a] = b
    for n in range(len(slots)):
        parent[slots[n]] = _root(parent, slots[n])


@inlined
def _root(parent, i):
    """Return the root of i, and let half of the particles on the way to it point farther up."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@sweep
def lower_labels(bonds, slots, border, label, parent):
    """Give each set of owned particles the lowest label of its members and of the ghosts that intact bonds join them to; return whether any fell.

    slots (n,) int32, owned; border (m,) int32, those of them with intact bonds to ghosts; label, parent as of join_intact, ghosts' labels fresh.
    """
    fell = False
    for n in range(len(slots)):
        i = slots[n]
        if 0 <= label[i] < label[parent[i]]:
            label[parent[i]], fell = label[i], True
    for n in range(len(border)):
        i = border[n]
        root = parent[i]
        for k in range(first_bond(bonds, i), end_of_bonds(bonds, i)):
            j = neighbour(bonds, i, k)
            if is_alive(bonds, i, k) and parent[j] < 0 and 0 <= label[j] < label[root]:
                label[root], fell = label[j], True
    for n in range(len(slots)):
        i = slots[n]
        if label[i] >= 0:
            label[i] = label[parent[i]]
    return fell
