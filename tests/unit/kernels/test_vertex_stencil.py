import numpy as np
import pytest

from pdhpc.kernels.vertex_stencil import Runs, stencil_forces


def grid(dim, seed=0):
    """Return (field, offset, coefficient of two stencils) over a small grid."""
    rng = np.random.default_rng(seed)
    stride = np.array([40, 1]) if dim == 2 else np.array([160, 40, 1])
    steps = np.stack([each.ravel() for each in np.meshgrid(*[[-1, 0, 1]] * dim, indexing="ij")], axis=1)
    return rng.standard_normal((dim, 1024)), steps @ stride, rng.standard_normal((2, 3**dim, dim, dim))


@pytest.mark.parametrize("dim", (2, 3))
def test_forces_are_the_sum_and_do_not_depend_on_where_a_run_begins(dim):
    field, offset, coefficient = grid(dim)
    found = []
    for runs in (Runs(np.array([300, 330]), np.array([21, 3]), np.array([0, 1])), Runs(np.array([300, 305, 330]), np.array([5, 16, 3]), np.array([0, 0, 1]))):
        force = np.zeros_like(field)
        stencil_forces(field, runs, offset, coefficient, np.empty((dim, 8)), force)
        found.append(force)
    assert np.array_equal(*found)
    for slot, row in ((300, 0), (307, 0), (320, 0), (332, 1)):
        assert found[0][:, slot] == pytest.approx(np.einsum("kab,bk->a", coefficient[row], field[:, slot + offset]), abs=1e-13)
    untouched = np.setdiff1d(np.arange(1024), np.r_[300:321, 330:333])
    assert not found[0][:, untouched].any()
