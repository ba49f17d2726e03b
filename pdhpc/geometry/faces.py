"""Area of the face of a set of lattice particles: what a traction on a region acts on."""
from pdhpc.jit import kernel


@kernel
def count_face(row_start, neighbour, reference, selected, axis, step):
    """Count the owned selected particles with no selected neighbour one lattice spacing away along an axis. Local.

    Parameters
    ----------
    row_start, neighbour : families of the owned particles. reference (n, dim), m. selected (n,) bool, owned and ghosts.
    axis : int; step : signed spacing, m.
    """
    dim = reference.shape[1]
    count = 0
    for i in range(len(row_start) - 1):
        if not selected[i]:
            continue
        covered = False
        for k in range(row_start[i], row_start[i + 1]):
            j = neighbour[k]
            if not selected[j]:
                continue
            apart = 0.0
            for d in range(dim):
                target = step if d == axis else 0.0
                apart = max(apart, abs(reference[j, d] - reference[i, d] - target))
            if apart < 0.25 * abs(step):
                covered = True
                break
        count += not covered
    return count
