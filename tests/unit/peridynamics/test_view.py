import numpy as np
import pytest

from pdhpc.peridynamics.view import View
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


@pytest.mark.parametrize("path", PATHS)
def test_a_view_is_the_owned_particles(path, lose_bonds):
    problem = problem_of(plate((6, 4)), [f"particles.path={path}"])
    view = View(problem.subdomain, problem.body.law)
    assert view.n == 24 and view.dim == 2 and np.array_equal(view.ids, np.arange(24))
    assert view.volume.sum() == pytest.approx(24.0) and len(view.block) == 24 and view.directed_bonds() == problem.subdomain.bonds.n_directed
    assert np.array_equal(view.places([3, 5]), view.places()[[3, 5]])
    view.prepare()
    assert view.broken() == 0 and view.foremost(np.arange(24), view.places()[:, 0], 0.3) == -1
    before = problem.subdomain.bonds.alive()[7]
    lose_bonds(problem.subdomain, 7)
    assert view.broken() >= 1 and view.foremost(np.arange(24), view.places()[:, 0], 0.3) == 7 and before > 0
