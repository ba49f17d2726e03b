from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.observers.fragments import Fragments
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS

CUT = '[[crack]]\ntype = "polyline"\npoints = [[{x}, -20.0], [{x}, 20.0]]\n'


def fragments_of(problem, comm, damage=0.35, particles=10):
    settings = SimpleNamespace(damage=damage, particles=particles)
    return Fragments(comm, settings, problem.parts[0], problem.body.law.density)


@pytest.mark.parametrize("path", PATHS)
def test_cuts_make_fragments(path, comm):
    """20 x 12, cut at x = -5 and 7: 60, 144 and 36 particles, of which the density is 1; their lowest ids are those of their lower left corners."""
    problem = problem_of(plate((20, 12), extra=CUT.format(x=-5.0) + CUT.format(x=7.0)), [f"particles.path={path}"])
    fragments = fragments_of(problem, comm)
    assert fragments.mass == pytest.approx(240.0)
    found = fragments.find(SimpleNamespace(step=0))
    assert (found["count"], found["dust"]) == (3, 0.0) and found["largest"] == pytest.approx(144 / 240, rel=1e-14)
    assert [(each["particles"], each["id"]) for each in found["heaviest"]] == [(144, 60), (60, 0), (36, 204)]
    assert [each["mass"] for each in found["heaviest"]] == pytest.approx([144.0, 60.0, 36.0])
    few = fragments_of(problem, comm, particles=37).find(SimpleNamespace(step=0))
    assert few["count"] == 2 and few["dust"] == pytest.approx(36 / 240, rel=1e-14), "what is too small is dust"
    assert fragments.columns[0] == "fragments" and fragments.read(SimpleNamespace(step=0)) == [3, found["largest"], 0.0]


@pytest.mark.parametrize("path", PATHS)
def test_damaged_particles_are_dust(path, comm, lose_bonds):
    """A column of particles without bonds at their own end divides a plate, whose other particles still have bonds to them."""
    problem = problem_of(plate((20, 12)), [f"particles.path={path}"])
    x = problem.subdomain.places()
    column = np.flatnonzero(np.abs(x[:, 0] - 0.5) < 3.0)  # as wide as bonds are long
    fragments = fragments_of(problem, comm)
    assert fragments.find(SimpleNamespace(step=0))["count"] == 1
    for row in column:
        lose_bonds(problem.subdomain, int(row))
    assert fragments.find(SimpleNamespace(step=0))["count"] == 1, "of a step it has seen it keeps what it found"
    found = fragments.find(SimpleNamespace(step=1))
    assert found["count"] == 2 and found["dust"] == pytest.approx(len(column) / 240, rel=1e-14)
    label = fragments.labels()
    assert np.all(label[column] == -1) and set(label[x[:, 0] < -3.0]) == {0}


def test_masses_follow_the_density(comm):
    stiff = '[[material]]\nname = "heavy"\ndensity = 3.0\nyoungs_modulus = 1.0\n[[body]]\nname = "b"\nmaterial = "heavy"\nshape = "box"\nlower = [20.0, -6.0]\nupper = [25.0, 6.0]\n'
    found = fragments_of(problem_of(plate((20, 12), extra=stiff)), comm).find(SimpleNamespace(step=0))
    assert [each["mass"] for each in found["heaviest"]] == pytest.approx([240.0, 180.0]) and found["largest"] == pytest.approx(240 / 420, rel=1e-14)
