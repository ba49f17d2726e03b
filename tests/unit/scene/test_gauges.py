import pytest

from pdhpc.scene.gauges import make_fragments, make_gauges
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate, problem_of

PROBES = '[[probe]]\nname = "p"\npoint = [0.4, 0.4]\nquantity = "velocity"\n[[probe]]\nname = "q"\nregion = "all"\nquantity = "reaction"\n[[tip]]\nname = "t"\nwindow = 0.5\n'


def test_gauges_are_those_of_the_scene(comm):
    problem = problem_of(plate((4, 4), extra=PROBES))
    view = problem.stepper().view
    energies, probes, tips = make_gauges(problem, view, comm)
    assert energies.columns[0] == "kinetic_energy [J]" and [probe.count for probe in probes] == [1, 16] and [tip.settings.name for tip in tips] == ["t"]
    assert view.places(probes[0].members).tolist() == [[0.5, 0.5]]


def test_a_region_without_a_particle_is_refused(comm):
    extra = '[[region]]\nname = "r"\nshape = "box"\nlower = [0.1, 0.1]\nupper = [0.2, 0.2]\n[[tip]]\nname = "t"\nregion = "r"\nwindow = 0.5\n'
    problem = problem_of(plate((4, 4), extra=extra))
    with pytest.raises(SceneError, match="tip 't': region = \"r\", which selects no particle"):
        make_gauges(problem, problem.stepper().view, comm)


def test_fragments_are_counted_when_asked_for(comm):
    assert make_fragments(problem_of(plate((4, 4))), comm) is None
    found = make_fragments(problem_of(plate((4, 4), extra="[fragments]\nparticles = 3\ndamage = 0.5\n")), comm)
    assert (found.settings.particles, found.settings.damage) == (3, 0.5) and found.mass == 16.0
