import numpy as np
import pytest

from pdhpc.geometry.points import PointBody
from pdhpc.geometry.shapes import Box


@pytest.fixture
def body():
    """Four points on a line, rows 1, 3, 4 and 7 of a file whose ids start at 100."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    return PointBody(100, 110, 4, np.array([101, 103, 104, 107]), points, np.full(4, 0.25), np.zeros(4, np.uint64), points[0], points[3], (0.4, 0.5, 0.6))


def test_points_of_a_half_open_box(body):
    ids, points = body.points_in(np.array([1.0, -1.0]), np.array([3.0, 1.0]))
    assert ids.tolist() == [103, 104] and points.tolist() == [[1.0, 0.0], [2.0, 0.0]]
    assert body.spacing == 0.5 and [each.tolist() for each in body.bounds()] == [[0.0, 0.0], [3.0, 0.0]]


def test_only_points_in_the_window(body):
    from dataclasses import replace

    seen = replace(body, window=Box((0.5, -1.0), (2.5, 1.0)))
    assert seen.points_in(np.full(2, -np.inf), np.full(2, np.inf))[0].tolist() == [103, 104]


def test_rows_by_id(body):
    assert body.rows_of(np.array([107, 100, 101, 105, 999])).tolist() == [3, -1, 0, -1, -1]
    from dataclasses import replace

    assert replace(body, id=body.id[:0]).rows_of(np.array([101])).tolist() == [-1]
