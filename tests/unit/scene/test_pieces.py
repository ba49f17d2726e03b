"""Supports of bodies that stand still, piece by piece."""
import pytest

from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.static import still

METHODS = ("newton", "relaxation")
APART = '[[body]]\nname = "apart"\nmaterial = "solid"\nshape = "box"\nlower = [20.0, -3.0]\nupper = [28.0, 3.0]\n'
CUT = '[[crack]]\ntype = "polyline"\npoints = [[{x}, -9.0], [{x}, 9.0]]\n'


def region(name, lower, upper):
    return f'[[region]]\nname = "{name}"\nshape = "box"\nlower = {lower}\nupper = {upper}\n'


def hold(name, value):
    return f'[[load]]\ntype = "displacement"\nregion = "{name}"\nvalue = {value}\n'


@pytest.mark.parametrize("path", ("lattice", "cloud"))
@pytest.mark.parametrize("method", METHODS)
def test_a_second_body_that_nothing_holds_is_named(method, path):
    """8 x 6 particles, its first one at (20.5, -2.5)."""
    found = r"leave 3 rigid motions free of the piece of 48 particles of body 'apart' around \(20.5, -2.5\) m, of 2 pieces that intact bonds hold together"
    with pytest.raises(SceneError, match=found) as error:
        problem_of(still((12, 6), method, extra=APART), [f"particles.path={path}"])
    assert f'displacements that hold each piece against all of them: time.method = "{method}" finds no equilibrium otherwise' in str(error.value)


@pytest.mark.parametrize("value, free", [('[0.0, "free"]', 1), ("[0.0, 0.0]", 0)])
def test_a_second_body_has_supports_of_its_own(value, free):
    """Held along x over a rectangle it cannot turn: y is free."""
    text = still((12, 6), "newton", extra=APART + region("there", [20.0, -3.0], [22.0, 3.0]) + hold("there", value))
    if free:
        with pytest.raises(SceneError, match="leave 1 rigid motion free of the piece of 48 particles of body 'apart'"):
            problem_of(text)
    else:
        assert problem_of(text).n_steps == 1


def test_glued_bodies_hold_each_other_and_an_interface_without_bonds_lets_go():
    near = APART.replace("20.0", "6.0").replace("28.0", "14.0")
    assert problem_of(still((12, 6), "newton", extra=near)).n_steps == 1
    parted = near + '[[interface]]\nbodies = ["body", "apart"]\nbonds = "none"\n'
    with pytest.raises(SceneError, match="body 'apart' around"):
        problem_of(still((12, 6), "newton", extra=parted))


def test_what_a_pre_crack_cuts_off_is_a_piece():
    """The held end is x < -3; of the others both rest on nothing."""
    found = r"3 rigid motions free of the piece of 24 particles of body 'body' around \(-1.5, -2.5\) m and some of 1 others, of 3 pieces"
    with pytest.raises(SceneError, match=found):
        problem_of(still((12, 6), "newton", extra=CUT.format(x=-2.0) + CUT.format(x=2.0)))


def test_a_piece_of_several_bodies_names_them():
    more = APART.replace("20.0", "28.0").replace("28.0]", "34.0]").replace("upper = [28.0", "upper = [34.0").replace("apart", "more")
    with pytest.raises(SceneError, match="of 84 particles of bodies 'apart' and 'more' around"):
        problem_of(still((12, 6), "newton", extra=APART + more))


def test_a_lone_particle_stands_still_by_itself_unless_a_load_moves_it():
    """A corner that pre-cracks cut free of every bond; gravity would take it away."""
    lone = '[[crack]]\ntype = "polyline"\npoints = [[5.0, -9.0], [5.0, -2.0], [9.0, -2.0]]\n'
    problem = problem_of(still((12, 6), "newton", extra=lone))
    assert (problem.subdomain.bonds.alive() == 0).sum() == 1
    with pytest.raises(SceneError, match=r"leave 2 rigid motions free of the piece of 1 particle of body 'body' around \(5.5, -2.5\) m, of 2 pieces"):
        problem_of(still((12, 6), "newton", extra=lone + '[[load]]\ntype = "gravity"\nvalue = [0.0, -1e-5]\n'))


def test_motions_that_move_nothing_are_not_free():
    """A row of particles in 3D has no turn around itself: held at both ends in all components it is held."""
    ends = "".join(region(name, [x, -1.0, -1.0], [x + 1.0, 1.0, 1.0]) + hold(name, "[0.0, 0.0, 0.0]") for name, x in (("low", -4.0), ("high", 3.0)))
    text = plate((8, 1, 1), extra=ends, dimension="3d").replace("end = 1.0\n", 'end = 1.0\nmethod = "newton"\n')
    assert problem_of(text).n_steps == 20
    with pytest.raises(SceneError, match="leave 2 rigid motions of the body free"):
        problem_of("[0.0, \"free\", \"free\"]".join(text.rsplit("[0.0, 0.0, 0.0]", 1)))
