"""What "auto" became, in numbers."""
import math

import pytest

from pdhpc.scene.settings import contact_values, impactor_values, strengths
from pdhpc.study.verify.case import plate, problem_of

FINER = '[[body]]\nname = "finer"\nmaterial = "solid"\nshape = "box"\nlower = [9.0, -2.0]\nupper = [12.0, 2.0]\nspacing = 0.5\nhorizon = 2.0\n'
PLANE = '[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, -9.0]\nnormal = [0.0, 4.0]\n'


def test_two_sizes_give_ranges():
    """1.35 spacings; 15 x 9 E/(pi delta^3) at horizons 3 and 2; E/h^2."""
    problem = problem_of(plate((6, 4), kinematics="finite", material="energy_release_rate = 0.1", extra=FINER + "[contact]\n" + PLANE))
    found = contact_values(problem.scene, problem.body)
    assert found["distance"] == pytest.approx([0.675, 1.35]) and found["stiffness"]["solid"] == pytest.approx([135 / (math.pi * 27), 135 / (math.pi * 8)])
    assert impactor_values(problem.scene, problem.body, problem.scene.impactor[0]) == {"solid": [1.0, 4.0]}
    rows = strengths(problem.body)
    assert [row["horizon"] for row in rows] == [3.0, 2.0] and rows[0]["critical_stretch"] == pytest.approx(math.sqrt(4 * math.pi * 0.1 / (9 * 3.0)), rel=0.06), "but for the lattice"


def test_bonds_that_break_by_energy_have_no_stretch():
    problem = problem_of(plate((6, 4), material='energy_release_rate = 0.1\nfailure = "energy"'))
    row, = strengths(problem.body)
    assert "critical_stretch" not in row and row["critical_pair_energy"] == pytest.approx(3 * 0.1 / (2 * 27))
