import numpy as np
import pytest

from pdhpc.parallel.travel import send_rows, share_pieces


@pytest.fixture
def alone():
    from mpi4py import MPI

    return MPI.COMM_SELF


def test_one_rank_keeps_everything_in_order(alone):
    pieces = [(np.arange(4.0).reshape(2, 2), np.array([1, 2])), (np.ones((1, 2)), np.array([3])), (np.ones((0, 2)), np.array([], int))]
    found = list(share_pieces(alone, iter(pieces)))
    assert [first for first, _ in found] == [0, 2, 3]
    assert np.array_equal(np.concatenate([each for _, (each, _) in found]), [[0, 1], [2, 3], [1, 1]]) and found[0][1][1].tolist() == [1, 2]


def test_what_goes_wrong_is_raised(alone):
    def pieces():
        yield (np.zeros(3),)
        raise ValueError("line 4")

    with pytest.raises(ValueError, match="line 4"):
        list(share_pieces(alone, pieces()))


def test_rows_stay(alone):
    points, ids = send_rows(alone, np.zeros(3, int), [np.arange(6.0).reshape(3, 2), np.array([5, 4, 3])])
    assert points.tolist() == [[0, 1], [2, 3], [4, 5]] and ids.tolist() == [5, 4, 3]
