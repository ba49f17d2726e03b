"""What holds together by intact bonds, found over all ranks."""
import numpy as np

from pdhpc.kernels.fragments import join_intact, lower_labels


def label_pieces(subdomain, bind, largest, whole):
    """Return (n_owned,) int64: the lowest id of the particles that intact bonds join each one to, -1 for those that do not count. Collective.

    Each rank joins its own particles, whose sets take their lowest id, then the lowest one that bonds across ranks lead to: an exchange of ghosts' ids a round
    until none changes, at least two.
    Costs 12 bytes a slot while it looks.

    Parameters
    ----------
    bind : function field -> what refreshes its ghosts. largest : function number -> the largest of the ranks' numbers.
    whole : (n_owned,) bool, the particles that count; bonds to others hold nothing together.
    """
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    slots = particles.slots
    label = np.full(len(particles.position), -1, np.int64)
    parent = np.full(len(label), -1, np.int32)
    label[slots[whole]] = particles.id[: particles.n_owned][whole]
    parent[slots] = slots
    ghosts, touches = bind(label), np.empty(len(slots), bool)
    ghosts.refresh()
    join_intact(arrays, slots, label, parent, touches)
    border = slots[touches]
    lower_labels(arrays, slots, border, label, parent)
    ghosts.refresh()
    while largest(int(lower_labels(arrays, slots, border, label, parent))):
        ghosts.refresh()
    ghosts.free()
    return label[slots]
