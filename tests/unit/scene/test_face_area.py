import numpy as np
import pytest

from pdhpc.scene.face_area import area_over_volume


@pytest.fixture
def measure():
    from mpi4py import MPI

    return lambda *arguments: area_over_volume(MPI.COMM_SELF, *arguments)


def lattice(counts, spacing):
    return np.stack(np.meshgrid(*[(np.arange(n) + 0.5) * spacing for n in counts], indexing="ij"), axis=-1).reshape(-1, len(counts))


@pytest.mark.parametrize("counts, axis, expected", [((3, 7), 0, 1 / 3), ((3, 7), 1, 1 / 7), ((3, 7, 5), 0, 1 / 3), ((3, 7, 5), 2, 1 / 5)])
def test_a_lattice_is_exact(measure, counts, axis, expected):
    """A/V of a box is one over its side along the axis."""
    dim, spacing, thickness = len(counts), 0.3, 0.02 if len(counts) == 2 else 1.0
    points = lattice(counts, spacing)
    volume = np.full(len(points), spacing**dim * thickness)
    assert measure(points, volume, thickness, axis) == pytest.approx(expected / spacing, rel=1e-12)


def test_layers_behind_each_other_count_once(measure):
    points = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5]])  # an L of three squares: from +x two of them, as from +y
    assert measure(points, np.ones(3), 1.0, 0) == pytest.approx(2 / 3) and measure(points, np.ones(3), 1.0, 1) == pytest.approx(2 / 3)


def test_squares_of_two_sizes(measure):
    """A square of side 2 beside two of side 1 that lie across its face's continuation: a shadow of 2 + 1 + 1 over a volume of 4 + 1 + 1."""
    points = np.array([[1.0, 1.0], [0.5, 2.5], [0.5, 3.5]])
    assert measure(points, np.array([4.0, 1.0, 1.0]), 1.0, 0) == pytest.approx(4 / 6, rel=1e-12)


def test_triangles_to_a_share_of_their_size(measure):
    """Squares halved along a diagonal, 40 x 3 of side 1: a face of 40 and a volume of 120, less and more by the overhang of the first and last square, 0.04 in all."""
    corners = lattice((3, 40), 1.0) - 0.5
    points = np.concatenate([corners + [1 / 3, 1 / 3], corners + [2 / 3, 2 / 3]])
    assert measure(points, np.full(len(points), 0.5), 1.0, 0) == pytest.approx(1 / 3, rel=1.5e-3)
