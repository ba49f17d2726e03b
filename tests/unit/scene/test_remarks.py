"""What is said of bodies that no bond joins, that pass through each other, or that a short distance of contact lets through."""
import pytest

from pdhpc.study.verify.case import plate, problem_of

OTHER = '[[body]]\nname = "other"\nmaterial = "solid"\nshape = "box"\nlower = [{x}, -2.0]\nupper = [{end}, 2.0]\n'
INTERFACE = '[[interface]]\nbodies = ["body", "other"]\nbonds = "{}"\n'
FLIES = '[[region]]\nname = "r"\nshape = "half_space"\npoint = [3.1, 0.0]\nnormal = [1.0, 0.0]\n[[initial]]\nregion = "r"\nvelocity = [-1.0, 0.0]\n'


def said(extra, x=3.0, kinematics="finite", overrides=()):
    """Return the warnings of a plate that ends at 3 and another that begins at x, their horizon 3 and bonds up to 3.5."""
    return problem_of(plate((6, 4), kinematics=kinematics, extra=OTHER.format(x=x, end=x + 6) + extra), list(overrides)).warnings


@pytest.mark.parametrize("x, gap", [(5.0, None), (5.25, None), (5.75, 3.75)])
def test_glued_bodies_that_no_bond_reaches(x, gap):
    """Centres are x - 3 + 1 apart."""
    found = said(INTERFACE.format("glued"), x)
    if gap is None:
        assert found == []
    else:
        assert len(found) == 1 and all(word in found[0] for word in ("'body' and 'other'", f"at least {gap} m apart", "reach 3.5 m")), found


@pytest.mark.parametrize("extra, x, kinematics, overrides, warns", [
    (INTERFACE.format("none"), 3.0, "finite", [], True),
    (INTERFACE.format("none") + "[contact]\n", 3.0, "finite", [], False),
    (INTERFACE.format("none"), 3.0, "linear", [], False),
    ("", 9.0, "finite", [], False),
    (FLIES, 9.0, "finite", [], True),
    (FLIES, 3.0, "finite", [], False),
])
def test_bodies_that_pass_through_each_other(extra, x, kinematics, overrides, warns):
    found = said(extra, x, kinematics, overrides)
    assert len(found) == warns and all("'body' and 'other'" in each and "no table [contact]" in each for each in found), found


@pytest.mark.parametrize("distance, warns", [(0.49, True), (0.5, False)])
def test_a_distance_of_contact_that_lets_particles_through(distance, warns):
    found = said(f"[contact]\ndistance = {distance}\n")
    assert len(found) == warns and all("contact.distance = 0.49 m is below 0.5 m" in each for each in found), found
