import numpy as np
import pytest

from pdhpc.conditions.time_functions import Constant
from pdhpc.fem.flat_top import FlatTop
from pdhpc.fem.loads import facets_where
from pdhpc.fem.nodes import Nodes
from pdhpc.fem.supports import Given, prescribe_on_facets
from pdhpc.study.verify.fem_problems import box_mesh, solid


def lower_left(x, n):
    return (n[:, 0] < -0.9) | (n[:, 1] < -0.9)


def test_hats_are_held_at_vertices(comm):
    mesh = box_mesh(comm, (2, 2), (2.0, 2.0))
    nodes = Nodes(mesh, False)
    (motion,) = prescribe_on_facets(solid(mesh), nodes, facets_where(mesh, lower_left)[0], [1], Given(lambda x: x + [0, 10], Constant()), "velocity")
    assert motion.indices.tolist() == [0, 1, 2, 3, 6] and motion.components.tolist() == [1] and not motion.displaces
    assert motion.value[:, 0] == pytest.approx([10.0, 11.0, 12.0, 10.0, 10.0])


def test_flat_tops_are_held_with_their_slopes_along_the_facets(comm):
    """On the left side constants and slopes along y, on the lower one along x, in the corner both; unknowns are numbered (function, component)."""
    mesh = box_mesh(comm, (2, 2), (2.0, 4.0))
    body = solid(mesh, basis=FlatTop("quad"))
    nodes = Nodes(mesh, False, body.width)
    gradient = np.array([[0.1, 0.2], [0.3, 0.4]])
    given = Given(lambda x: x @ gradient.T, Constant(), lambda x: np.tile(gradient, (len(x), 1, 1)))
    motions = prescribe_on_facets(body, nodes, facets_where(mesh, lower_left)[0], [0], given)
    held = {tuple(motion.components.tolist()): motion for motion in motions}
    assert {key: motion.indices.tolist() for key, motion in held.items()} == {(0, 4): [1, 2], (0, 2): [3, 6], (0, 2, 4): [0]}
    assert held[0, 4].value == pytest.approx(np.array([[0.4, 0.2 * 2], [0.8, 0.2 * 2]]))  # value and h_y du_x/dy, h_y = 2
    assert held[0, 2, 4].value == pytest.approx(np.array([[0.0, 0.1, 0.4]]))


def test_constants_have_no_slope(comm):
    mesh = box_mesh(comm, (1, 1))
    body = solid(mesh, basis=FlatTop("quad"))
    motions = prescribe_on_facets(body, Nodes(mesh, False, 6), facets_where(mesh, lower_left)[0], (0, 1), Given([1.0, 2.0], Constant()))
    corner = next(motion for motion in motions if len(motion.components) == 6)
    assert corner.value.tolist() == [[1.0, 2.0, 0, 0, 0, 0]]
