"""Impactors that start inside a body are refused; a start in touch is not."""
import pytest

from pdhpc.scene.schema import SceneError
from pdhpc.study import estimate as module
from pdhpc.study.estimate import estimate
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate, problem_of

PLANE = '[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, {y}]\nnormal = [0.0, 1.0]\n'
DISK = '[[impactor]]\nname = "d"\nshape = "cylinder"\ncenter = [0.0, {y}]\nradius = {radius}\n'


def scene(extra):
    """6 x 4 particles of side 1 around 0: the lowest centres at y = -1.5, the highest at 1.5."""
    return plate((6, 4), kinematics="finite", extra=extra)


def refusal(extra):
    with pytest.raises(SceneError) as error:
        problem_of(scene(extra))
    return str(error.value)


@pytest.mark.parametrize("y, depth", [(-1.9, 0.1), (0.0, 2.0)])
def test_a_plane_that_cuts_a_body_is_refused_with_its_depth(y, depth):
    said = refusal(PLANE.format(y=y))
    assert all(word in said for word in ("impactor 'p': point", "body 'body'", f": {depth:g} m past the surface", "at least 0.5 m", f"at least {depth:g} m farther away")), said


def test_a_disk_inside_a_body_is_refused():
    """The particles nearest to its centre, at (0.5, 0.5), lie sqrt(0.5) - 0.4 from its surface: 0.192893 m deep."""
    assert "0.192893 m past the surface" in refusal(DISK.format(y=0.0, radius=0.4))


def test_the_second_impactor_and_the_other_body_are_named():
    other = '[[body]]\nname = "b"\nmaterial = "solid"\nshape = "box"\nlower = [-3.0, 9.0]\nupper = [3.0, 11.0]\n'
    said = refusal(other + PLANE.format(y=-9.0) + DISK.format(y=12.9, radius=2.0))
    assert "impactor 'd': center = [0.0, 12.9]" in said and "body 'b'" in said


@pytest.mark.parametrize("y", [-2.0, -2.0 + 1e-7, -7.0])
def test_touching_within_rounding_is_allowed(y):
    problem_of(scene(PLANE.format(y=y))).stepper()


def test_a_body_that_starts_displaced_is_looked_at_where_it_is():
    moved = "[[initial]]\ndisplacement = [0.0, -1.0]\n"
    assert ": 0.5 m past" in refusal(moved + PLANE.format(y=-2.5))
    problem_of(scene(moved + PLANE.format(y=-3.0)))


@pytest.mark.parametrize("small", [True, False])
def test_check_refuses_it_too_whether_it_builds_or_samples(small, monkeypatch):
    if not small:
        monkeypatch.setattr(module, "_SMALL", 0)
    with pytest.raises(SceneError, match=r"impactor 'p'.*body 'body': 0\.1 m past"):
        estimate(parse_scene(scene(PLANE.format(y=-1.9)), "t"), 1)
    estimate(parse_scene(scene(PLANE.format(y=-2.0)), "t"), 1)
