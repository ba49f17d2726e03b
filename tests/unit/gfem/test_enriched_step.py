import numpy as np
import pytest

from pdhpc.gfem.enriched_step import enriched_step


def test_largest_frequency_of_a_dense_system(comm):
    """Two blocks of unknowns with masses; 2/omega_max of K u = omega^2 M u."""
    random = np.random.default_rng(5)
    mass, root = random.uniform(0.5, 2.0, 12), random.normal(size=(12, 12))
    stiffness = root @ root.T
    respond = lambda u: split(stiffness @ np.concatenate([part.ravel() for part in u]) / mass)  # noqa: E731
    split = lambda x: [x[:4].reshape(2, 2), x[4:].reshape(4, 2)]  # noqa: E731
    found = enriched_step(comm, split(random.normal(size=12)), respond, split(mass))
    assert found == pytest.approx(2.0 / np.sqrt(np.linalg.eigvals(stiffness / mass[:, None]).real.max()), rel=1e-8)


def test_no_stiffness_has_no_critical_step(comm):
    ones = [np.ones((3, 1))]
    assert enriched_step(comm, ones, lambda u: [0.0 * u[0]], ones) == np.inf
    assert enriched_step(comm, [np.zeros((3, 1))], lambda u: u, ones) == np.inf
