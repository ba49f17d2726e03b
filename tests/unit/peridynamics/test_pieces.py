import numpy as np
import pytest

from pdhpc.peridynamics.pieces import label_pieces
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS

CUT = '[[crack]]\ntype = "polyline"\npoints = [[{x}, -20.0], [{x}, 20.0]]\n'


@pytest.mark.parametrize("path", PATHS)
def test_pieces_are_called_by_their_lowest_id(path):
    """20 x 12 particles, cut at x = 0; then without the column x = 5.5 and what is within three particles of it."""
    problem = problem_of(plate((20, 12), extra=CUT.format(x=0.0)), [f"particles.path={path}"])
    subdomain, bind = problem.subdomain, problem.parts[0].exchange.bind
    x, ids = subdomain.places()[:, 0], subdomain.particles.id[: subdomain.particles.n_owned]
    label = label_pieces(subdomain, bind, int, np.ones(len(x), bool))
    assert set(label[x < 0]) == {ids[x < 0].min()} and set(label[x > 0]) == {ids[x > 0].min()}
    whole = np.abs(x - 5.5) > 2.0
    label = label_pieces(subdomain, bind, int, whole)
    assert np.all(label[~whole] == -1) and len(set(label[whole])) == 3
