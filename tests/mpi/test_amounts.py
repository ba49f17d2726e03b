"""Volumes of bodies are the same digits on any number of ranks, whether one region or two."""
import pytest

from pdhpc.scene.amounts import amounts_of
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate

DISK = '[[body]]\nname = "d"\nmaterial = "solid"\nshape = "disk"\ncenter = [2.0, 0.0]\nradius = 0.73\n'
FINE = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 0.4\nstep_ratio = 2\n'


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("extra", [DISK, DISK + FINE])
def test_same_amounts_on_any_number_of_ranks(comm, extra):
    from mpi4py import MPI

    scene = parse_scene(plate((24, 16), spacing=0.1, extra=extra), "t")
    problems = [(build(scene, each), each) for each in (comm, MPI.COMM_SELF)]
    found = [amounts_of(scene, problem.body, problem.parts, each) for problem, each in problems]
    assert found[0] == found[1] and found[0][0].particles == 384 and found[0][1].particles > 100
