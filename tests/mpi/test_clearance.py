"""An impactor inside a body is refused with the same sentence on every rank, whatever rank the deepest particle is on."""
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate

DISK = '[[impactor]]\nname = "d"\nshape = "cylinder"\ncenter = [{x}, 5.0]\nradius = 1.2\n'


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("x", [-9.0, 0.0, 9.0])
def test_same_sentence_on_every_rank(comm, x):
    """The nearest centres lie (0.5, 0.5) from that of the disk: 0.5 + 1.2 - sqrt(0.5) = 0.992893 deep."""
    with pytest.raises(SceneError) as error:
        build(parse_scene(plate((24, 12), kinematics="finite", extra=DISK.format(x=x)), "t"), comm)
    said = comm.allgather(str(error.value))
    assert len(set(said)) == 1 and ": 0.992893 m past" in said[0]
