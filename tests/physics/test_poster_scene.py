"""runs/poster_splitting.toml as it ships: what its head says of it."""
from pathlib import Path

import numpy as np
import pytest

from pdhpc.gfem.display import displayed
from pdhpc.scene.build import build
from pdhpc.scene.read import read_scene

SCENE = Path(__file__).resolve().parents[2] / "runs" / "poster_splitting.toml"
LATTICE = (20, 20)


def field(view, name):
    """Return a field of all particles by column and row of the lattice."""
    values, place = view.field(name), np.rint(view.places() / 0.05 - 0.5).astype(int)
    result = np.empty(LATTICE + values.shape[1:])
    result[tuple(place.T)] = values
    return result


def run(comm, *overrides):
    """Return the stepper at the end of the scene."""
    problem = build(read_scene(str(SCENE), list(overrides)), comm)
    stepper = problem.stepper()
    for _ in range(problem.n_steps):
        stepper.advance()
    stepper.view.prepare()
    return stepper


@pytest.fixture(scope="module")
def split():
    from mpi4py import MPI

    return run(MPI.COMM_SELF)


def test_it_takes_twenty_steps_of_five(split):
    assert (split.step, split.k) == (20, 5) and split.failure is None


def test_it_splits_along_the_middle(split):
    """Mirror images about y = 0.5, in lost bonds exactly. Particles beside that line have lost half of theirs or more up to x = 0.4; none has right of the middle."""
    damage, u = field(split.view, "damage"), field(split.view, "displacement")
    assert np.array_equal(damage, damage[:, ::-1]) and u == pytest.approx(u[:, ::-1] * [1.0, -1.0], abs=1e-9)
    assert damage[:8, 9:11].min() >= 0.5 and damage[8:, 9:11].max() < 0.5 and not damage[10:].any() and not damage[:, :7].any()
    opening = u[0, 10, 1] - u[0, 9, 1]
    assert opening > 1.5 * 0.05 and split.broken // 2 == 385


def test_vertices_around_the_crack_are_enriched(split):
    """The middle rows of vertices in the left half, in x and in y; one that lies on the tolerance may be missing."""
    from mpi4py import MPI

    data, _ = displayed(MPI.COMM_SELF, split)
    enriched = data["vertices/enriched"][np.argsort(data["vertices/id"])].reshape(5, 5, 2)
    assert not enriched[3:].any() and not enriched[:, [0, 4]].any()
    assert enriched[:3, 1:4].sum(axis=(0, 1)).tolist() == pytest.approx([9, 9], abs=1)
    assert np.array_equal(enriched, enriched[:, ::-1])


def test_it_follows_particles_alone(split):
    """2.7 %, as far as these move at half the step; all functions reproduce them to round-off, and 1 % less load moves what is compared by more."""
    from mpi4py import MPI

    alone = run(MPI.COMM_SELF, "model=particles", "time.dt=0.018")
    expected = field(alone.view, "displacement")
    error = lambda stepper: np.linalg.norm(field(stepper.view, "displacement") - expected) / np.linalg.norm(expected)  # noqa: E731
    assert alone.step == 100 and error(split) < 0.05
    everything = run(MPI.COMM_SELF, "gfem.tolerance=0.0")
    assert error(everything) < 1e-9 and everything.broken == alone.broken
    assert error(run(MPI.COMM_SELF, "gfem.tolerance=0.0", "load.pull_up.value=[0.0, 0.1287]")) > 1e-3
