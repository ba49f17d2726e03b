"""What ranks hold of one body: ghosts and their bytes, cuts between layers, ranks that own nothing."""
import itertools

import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate

PATHS, MODELS = ("lattice", "cloud"), {"pmb": [], "lps": ["material.solid.model=lps", "material.solid.poissons_ratio=0.1"]}
CASES = list(itertools.product(PATHS, MODELS, (2, 3)))


def problem_on(comm, path, model="pmb", dim=2, cells=None, **changes):
    cells = cells or ((40, 21) if dim == 2 else (14, 9, 10))
    text = plate(cells, 2.0, dimension="3d" if dim == 3 else "plane_stress", **changes)
    return build(parse_scene(text, "t", [f"particles.path={path}", *MODELS[model]]), comm)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, model, dim", CASES)
def test_a_step_sends_what_ghosts_need_and_nothing_else(comm, path, model, dim):
    """8 bytes for each component of the position of each ghost; p of each ghost of a state-based law too; not the padding of rows of four."""
    problem = problem_on(comm, path, model, dim)
    internal, particles = problem.stepper().internal, problem.subdomain.particles
    ghosts = comm.allreduce(particles.n_ghost)
    assert comm.allreduce(problem.exchange.sent) == ghosts > 0
    assert internal.bytes_sent == 8 * (dim + (model == "lps")) * problem.exchange.sent
    assert comm.allreduce(internal.bytes_sent) == 8 * (dim + (model == "lps")) * ghosts


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, dim", list(itertools.product(PATHS, (2, 3))))
def test_ghosts_are_the_neighbours_that_others_own(comm, path, dim):
    problem = problem_on(comm, path, dim=dim)
    subdomain, particles = problem.subdomain, problem.subdomain.particles
    everyone = comm.allgather((particles.id[: particles.n_owned], subdomain.places()))
    ids, places = np.concatenate([each[0] for each in everyone]), np.concatenate([each[1] for each in everyone])
    owner = np.repeat(np.arange(comm.size), [len(each[0]) for each in everyone])
    assert len(set(ids.tolist())) == len(ids) == (840 if dim == 2 else 1260)
    near = set()
    for i, at in enumerate(subdomain.places()):
        r = np.linalg.norm(places - at, axis=1)
        near.update(ids[(r < 2.5 - 1e-6) & (owner != comm.rank)].tolist())  # radius delta + h/2, excluded
    ghosts = particles.id[particles.n_owned :]
    assert near == set(ghosts.tolist()) and len(near) == len(ghosts)
    by_id = {i: (rank, place.tolist()) for i, rank, place in zip(ids.tolist(), owner.tolist(), places)}
    assert [by_id[i] for i in ghosts.tolist()] == list(zip(subdomain.ghost_owner.tolist(), subdomain.places_at(particles.ghost_slots).tolist()))


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, dim", list(itertools.product(PATHS, (2, 3))))
def test_fresh_ghosts_of_moved_particles(comm, path, dim):
    """After an evaluation the ghosts stand where their owners put them, and carry the owners' p."""
    problem = problem_on(comm, path, "lps", dim)
    particles, subdomain = problem.subdomain.particles, problem.subdomain
    gradient = 1e-3 * np.random.default_rng(0).standard_normal((dim, dim))
    x = subdomain.places()
    particles.put(particles.displacement, x @ gradient + 1e-5 * x**2)
    problem.stepper()
    ghosts = subdomain.places_at(particles.ghost_slots)
    assert np.array_equal(particles.position[particles.ghost_slots, :dim], ghosts @ gradient + 1e-5 * ghosts**2)
    known = {}
    for each in comm.allgather(dict(zip(particles.id[: particles.n_owned].tolist(), particles.owned(subdomain.state).tolist()))):
        known.update(each)
    assert subdomain.state[particles.ghost_slots].tolist() == [known[i] for i in particles.id[particles.n_owned :].tolist()]


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("dim", (2, 3))
def test_a_lattice_is_cut_between_layers_and_its_bonds_are_shared(comm, dim):
    """Each rank holds a box of whole layers; nobody has more than 3 % or one layer above the mean."""
    problem = problem_on(comm, "lattice", dim=dim, cells=(60, 41) if dim == 2 else (24, 17, 16))
    x = problem.subdomain.places()
    lower, upper = x.min(axis=0), x.max(axis=0)
    assert len(x) == np.prod(np.rint(upper - lower) + 1), "a full box of cells"
    work = np.array(comm.allgather(problem.subdomain.bonds.n_directed))
    family = int(problem.subdomain.bonds.family_size.max())
    layer = max(comm.allgather(float(np.prod(np.sort(upper - lower + 1)[-(dim - 1) :])))) * family
    assert work.max() - work.mean() <= max(0.03 * work.mean(), layer)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, model", list(itertools.product(PATHS, MODELS)))
def test_a_rank_that_owns_nothing_takes_part(comm, path, model):
    """Two particles for all ranks: steps, ledger and fields work with empty shares."""
    problem = problem_on(comm, path, model, cells=(2, 1))
    stepper = problem.stepper()
    for _ in range(3):
        stepper.advance()
    owned = comm.allgather(problem.subdomain.particles.n_owned)
    assert sum(owned) == 2 and max(owned) <= 2
    assert all(len(values) == problem.subdomain.particles.n_owned for name, values in stepper.ledger().items() if name != "external_work")
    if problem.subdomain.particles.n_owned == 0:
        assert problem.subdomain.places().shape == (0, 2) and stepper.internal.bytes_sent == 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, model", list(itertools.product(PATHS, MODELS)))
def test_momentum_is_conserved_across_ranks(comm, path, model):
    """Newton's third law between ranks: internal forces of a shaken free body sum to zero."""
    problem = problem_on(comm, path, model, kinematics="finite")
    particles, x = problem.subdomain.particles, problem.subdomain.places()
    particles.put(particles.displacement, 1e-2 * np.stack([np.sin(0.7 * x[:, 0] * x[:, 1]), np.cos(1.3 * x[:, 0] + x[:, 1])], axis=1))
    problem.stepper()
    force = particles.owned(particles.force_density)
    total, size = comm.allreduce(force.sum(axis=0)), comm.allreduce(np.abs(force).sum())
    assert np.abs(total).max() < 1e-13 * size and size > 0.1
