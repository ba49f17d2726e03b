"""Scene -> what holds a body of particles that stands still: each piece of it against every rigid motion."""
from functools import partial

import numpy as np

from pdhpc.parallel.comm import largest
from pdhpc.peridynamics.pieces import label_pieces

_RANK = 1e-10  # of the largest eigenvalue: below, nothing holds a rigid motion, or it moves nothing
_NOTHING = 1e-300  # for the largest eigenvalue of a piece that nothing holds
_TURNS = {2: [(0, 1)], 3: [(0, 1), (1, 2), (2, 0)]}  # from one axis to another


def check_supports(scene, body, part, comm):
    """Raise a SceneError unless prescribed components hold each piece, particles that intact bonds join, against its rigid motions. Collective.

    A piece that is not held has no equilibrium under loads, and none of its own without. A particle without bonds and loads stands still by itself.
    Every rank keeps some tables with rows for all pieces.
    """
    particles = part.subdomain.particles
    alone = (part.subdomain.bonds.alive() == 0) & ~_loaded(part)
    label = label_pieces(part.subdomain, part.exchange.bind, partial(largest, comm), ~alone)
    own = np.unique(label[~alone])
    first = np.unique(np.concatenate(comm.allgather(own)))
    if len(first) == 0:
        return
    rows = np.flatnonzero(~alone)
    number = np.searchsorted(first, label[rows])
    free = _free_motions(part.subdomain.places()[rows], part.conditions.held()[rows], number, len(first), comm)
    loose = np.flatnonzero(free)
    if len(loose) == 0:
        return
    if len(first) == 1:
        found, whole = f"{_motions(free[0])} of the body free", "the body"
    else:
        members = rows[number == loose[0]]
        others = f" and some of {len(loose) - 1} others" if len(loose) > 1 else ""
        piece = _called(scene, body, part, comm, members, particles.id[: particles.n_owned] == first[loose[0]])
        found, whole = f"{_motions(free[loose[0]])} free of the piece {piece}{others}, of {len(first)} pieces that intact bonds hold together", "each piece"
    raise scene.error("load", f"prescribed displacements that leave {found}",
                      f'displacements that hold {whole} against all of them: time.method = "{scene.method}" finds no equilibrium otherwise')


def _loaded(part):
    """Return (n_owned,) bool: the particles that loads act on at some time. Local."""
    by_slot = np.zeros(len(part.subdomain.points.position), bool)
    for load in part.conditions.loads:
        by_slot[load.indices[np.any(load.vector != 0.0, axis=1)]] = True
    return by_slot[part.subdomain.particles.slots]


def _free_motions(x, held, number, count, comm):
    """Return (count,) int: how many rigid motions of each piece supports leave free, of those that move it. Collective.

    x (n, dim), m; held (n, dim) bool; number (n,) the piece of each particle. With R_i the motions at particle i, turns around the middle of its piece by its
    size, they are the rank of sum R_i^T R_i less that of the same over held components alone.
    """
    dim = x.shape[1]

    def sums(values):
        return comm.allreduce(np.bincount(number, values, count))

    many = sums(np.ones(len(x)))
    middle = np.stack([sums(x[:, axis]) for axis in range(dim)], axis=1) / many[:, None]
    x = x - middle[number]
    size = np.sqrt(sums(np.square(x).sum(axis=1)) / many)
    x /= np.where(size > 0.0, size, 1.0)[number, None]
    motions = np.zeros((len(x), dim, dim + len(_TURNS[dim])))
    motions[:, :, :dim] = np.eye(dim)
    for turn, (a, b) in enumerate(_TURNS[dim]):
        motions[:, a, dim + turn], motions[:, b, dim + turn] = -x[:, b], x[:, a]
    ranks = []
    for parts in (motions, motions * held[:, :, None]):
        squares = np.empty((count, motions.shape[2], motions.shape[2]))
        for a in range(motions.shape[2]):
            for b in range(a + 1):
                squares[:, a, b] = squares[:, b, a] = sums((parts[:, :, a] * parts[:, :, b]).sum(axis=1))
        eigenvalues = np.linalg.eigvalsh(squares)
        ranks.append(np.count_nonzero(eigenvalues > _RANK * np.maximum(eigenvalues[:, -1:], _NOTHING), axis=1))
    return ranks[0] - ranks[1]


def _called(scene, body, part, comm, members, first):
    """Return how a piece is called: of how many particles of which bodies, and where its first particle is. Collective.

    members (n,) : rows of owned particles of it. first (n_owned,) bool : that particle, on the rank that owns it.
    """
    particles = part.subdomain.particles
    numbers = sorted(set().union(*comm.allgather(set(body.number_of(particles.id[members]).tolist()))))
    names = " and ".join(f"'{scene.body[number].name}'" for number in numbers)
    place = comm.allreduce(part.subdomain.places(np.flatnonzero(first)).sum(axis=0))
    many = comm.allreduce(len(members))
    where = ", ".join(f"{x:.6g}" for x in place)
    return f"of {many} particle{'s' if many > 1 else ''} of bod{'ies' if len(numbers) > 1 else 'y'} {names} around ({where}) m"


def _motions(number):
    """Return a number of rigid motions in words."""
    return f"{number} rigid motion{'s' if number > 1 else ''}"
