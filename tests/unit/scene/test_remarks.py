"""What is said of bodies that no bond joins, that pass through each other, or that a short distance of contact lets through."""
import pytest

from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.bodies import write_cells
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


TABLE = '[[body]]\nname = "grains"\nmaterial = "solid"\nshape = "table"\nfile = "{}"\n'


@pytest.mark.parametrize("rows, word", [
    ([(x, y) for x in (3.5, 4.5) for y in (-1.2, -0.2, 0.8)], None),
    ([(3.5, -1.5), (3.5, -0.5), (3.1, 0.5), (3.5, 1.5)], "overlap"),
    ([(x, y) for x in (3.1, 4.1) for y in (-1.5, -0.5, 0.5, 1.5)], "allowed is bodies that do not overlap"),
])
def test_a_table_that_comes_too_near_a_box(rows, word, tmp_path):
    """The box ends at 3.0, its last centres at 2.5: grains at 3.1 reach 0.4 into it, which neither a quarter of a spacing nor a full family shows."""
    (tmp_path / "grains.txt").write_text("".join(f"{x} {y} 1 1\n" for x, y in rows))
    text = plate((6, 4), kinematics="finite", extra=TABLE.format(tmp_path / "grains.txt"))
    if word and word.startswith("allowed"):
        with pytest.raises(SceneError, match=f"'body' and 'grains'; {word}"):
            problem_of(text)
        return
    found = problem_of(text).warnings
    assert len(found) == (word is not None) and all("'body' and 'grains'" in each and word in each for each in found), found


def test_cells_that_stand_in_a_file_again(tmp_path):
    """In a file of 4 x 3 squares the first one again: of particles and of finite elements alike."""
    import meshio

    write_cells(tmp_path / "cells.inp", (4, 3))
    mesh = meshio.read(tmp_path / "cells.inp")
    again = meshio.Mesh(mesh.points, [("quad", mesh.cells[0].data), ("quad", mesh.cells[0].data[:1])])
    again.write(tmp_path / "again.vtk")
    body = f'shape = "mesh"\nfile = "{tmp_path / "again.vtk"}"'
    box = 'shape = "box"\nlower = [-3.0, -2.0]\nupper = [3.0, 2.0]'
    for text in (plate((6, 4)).replace(box, body), FEM.format(tmp_path / "again.vtk")):
        found = problem_of(text)
        assert [each for each in found.warnings if "1 cell stands there again" in each and "again.vtk" in each] == found.warnings != []
    assert problem_of(FEM.format(tmp_path / "cells.inp")).warnings == []


FEM = """
model = "fem"
dimension = "plane_stress"
[mesh]
file = "{}"
[[material]]
name = "solid"
model = "elastic"
density = 1.0
youngs_modulus = 1.0
poissons_ratio = 0.3
[[body]]
name = "body"
material = "solid"
shape = "mesh"
[time]
end = 1.0
"""


@pytest.mark.parametrize("distance, warns", [(0.49, True), (0.5, False)])
def test_a_distance_of_contact_that_lets_particles_through(distance, warns):
    found = said(f"[contact]\ndistance = {distance}\n")
    assert len(found) == warns and all("contact.distance = 0.49 m is below 0.5 m" in each for each in found), found
