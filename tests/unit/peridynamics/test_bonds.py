import numpy as np
import pytest

from pdhpc.peridynamics.bonds import find_families
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


@pytest.mark.parametrize("path", PATHS)
def test_damage_is_told_apart_from_the_pre_crack(path, lose_bonds):
    problem = problem_of(plate((12, 12), extra='[[crack]]\ntype = "polyline"\npoints = [[-6.0, 0.0], [0.0, 0.0]]'), [f"particles.path={path}"])
    bonds, x = problem.subdomain.bonds, problem.subdomain.places()
    assert np.all(bonds.damage() == 0.0)
    near = (np.abs(x[:, 1]) < 1) & (x[:, 0] < -1)
    assert np.all(bonds.precrack()[near] > 0.3) and np.all(bonds.precrack()[np.abs(x[:, 1]) > 4] == 0.0)
    lose_bonds(problem.subdomain, 0)
    assert bonds.damage()[0] == 1.0 and bonds.precrack()[0] == 0.0 and np.count_nonzero(bonds.damage()) == 1


def test_a_lone_particle_has_no_damage():
    bonds, keep = find_families(np.zeros((1, 2)), np.array([5]), 1, 1.0)
    assert bonds.damage().tolist() == [0.0] and bonds.precrack().tolist() == [0.0] and keep.tolist() == [True]


def test_points_that_are_nobody_s_neighbour_are_dropped():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [1.0, 1.0]])
    bonds, keep = find_families(points, np.arange(4), 1, 1.1)
    assert keep.tolist() == [True, True, False, False]
    assert bonds.arrays.neighbour[0] == 1 and bonds.n_directed == 1


def test_coinciding_particles_are_refused():
    with pytest.raises(ValueError, match="same place"):
        find_families(np.zeros((2, 2)), np.arange(2), 2, 1.0)
