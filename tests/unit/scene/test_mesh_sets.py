import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from tests.unit.scene.test_mesh_body import FILE
from tests.unit.scene.test_mesh_rules import FEM, SECOND

BOX = '[[region]]\nname = "{name}"\nshape = "box"\nlower = {lower}\nupper = {upper}\n'
TRACTION = '[[load]]\nname = "l"\ntype = "traction"\nregion = "{region}"\nface = "{face}"\nvalue = [0.5, 2.0]\n'


def problem_of(comm, text, overrides=()):
    return build(parse_scene(text, "t", overrides), comm)


def forces(problem):
    """Return (n_owned, dim), N, of the loads at t = 0."""
    nodes = problem.nodes
    nodes.force[...] = 0.0
    problem.conditions.add_loads(0.0)
    return nodes.owned(nodes.force)


@pytest.mark.parametrize("depth", [0.02, 0.5, 2.0])
def test_traction_acts_on_the_facets_of_its_face(comm, depth):
    """A region of any depth: total force = traction x length x thickness, on the vertices of the face alone."""
    extra = BOX.format(name="top", lower=[0.0, 5.0 - depth], upper=[10.0, 5.0]) + TRACTION.format(region="top", face="+y")
    problem = problem_of(comm, FEM + extra, ["mesh.thickness=0.1"])
    found, y = forces(problem), problem.body.mesh.points[:, 1]
    assert found.sum(axis=0) == pytest.approx([0.5, 2.0]) and not found[y < 5.0].any() and np.count_nonzero(found[:, 0]) == 21


def test_only_facets_within_the_region(comm):
    extra = BOX.format(name="part", lower=[2.0, 4.0], upper=[5.0, 5.0]) + TRACTION.format(region="part", face="+y")
    found = forces(problem_of(comm, FEM + extra))
    assert found.sum(axis=0) == pytest.approx([1.5, 6.0])


def test_weight_and_force_density(comm):
    extra = '[[load]]\ntype = "gravity"\nvalue = [0.0, -9.81]\n' + BOX.format(name="low", lower=[0.0, 0.0], upper=[3.0, 1.25]) + (
        '[[load]]\ntype = "force_density"\nregion = "low"\nvalue = [1.5, 0.0]\n')
    found = forces(problem_of(comm, FEM + extra, ["material.m.density=2.0"])).sum(axis=0)
    assert found == pytest.approx([1.5 * 3.0 * 1.25, -2.0 * 9.81 * 50.0])  # half of a row of cells counts by half


@pytest.mark.parametrize("lower, upper", [([1.1, 2.13], [1.2, 2.17]), ([-1.0, 0.3], [3.3, 1.9])])
def test_a_part_of_cells_is_loaded_where_it_lies(comm, lower, upper):
    """A region within one cell, and one that cuts a row: resultant and moment are those of the region in the body."""
    text = FEM + BOX.format(name="r", lower=lower, upper=upper) + '[[load]]\ntype = "force_density"\nregion = "r"\nvalue = [0.0, 2.0]\n'
    problem = problem_of(comm, text, ["mesh.thickness=0.1"])
    low, high = np.maximum(lower, 0.0), np.array(upper)
    volume, found = 0.1 * np.prod(high - low), forces(problem)[:, 1]
    assert found.sum() == pytest.approx(2.0 * volume) and found @ problem.body.mesh.points / found.sum() == pytest.approx((low + high) / 2)
    (record,) = problem.sizes(problem.stepper(), comm)["loads"]
    assert record == {"name": 0, "type": "force_density", "resultant": pytest.approx([0.0, 2.0 * volume]), "volume": pytest.approx(volume)}


def test_a_part_of_facets_is_loaded_where_it_lies(comm):
    """From x = 1.6 to 4.3 on cells of 0.5: 2.7 of traction, its middle at 2.95."""
    extra = BOX.format(name="part", lower=[1.6, 4.9], upper=[4.3, 5.0]) + TRACTION.format(region="part", face="+y")
    problem = problem_of(comm, FEM + extra, ["mesh.thickness=0.1"])
    found = forces(problem)
    assert found.sum(axis=0) == pytest.approx([0.135, 0.54]) and found[:, 0] @ problem.body.mesh.points[:, 0] / 0.135 == pytest.approx(2.95)
    (record,) = problem.sizes(problem.stepper(), comm)["loads"]
    assert record == {"name": "l", "type": "traction", "resultant": pytest.approx([0.135, 0.54]), "area": pytest.approx(0.27)}


def test_motions_hold_vertices_within_their_region(comm):
    extra = BOX.format(name="left", lower=[0.0, 0.0], upper=[0.7, 5.0]) + '[[load]]\ntype = "velocity"\nregion = "left"\nvalue = ["free", 2.0]\n'
    problem = problem_of(comm, FEM + extra)
    motion, = problem.conditions.motions
    slots = problem.nodes.owned_slots
    assert motion.components.tolist() == [1] and np.array_equal(np.isin(slots, motion.indices), problem.body.mesh.points[:, 0] < 0.7)
    problem.stepper()
    assert np.allclose(problem.nodes.velocity[motion.indices], [0.0, 2.0])


def test_regions_can_be_tied_to_a_body(comm):
    extra = SECOND + BOX.format(name="part", lower=[8.0, 0.0], upper=[15.0, 5.0]) + 'body = "c"\n[[load]]\ntype = "force_density"\nregion = "part"\nvalue = [1.0, 0.0]\n'
    problem = problem_of(comm, FEM + extra)
    assert forces(problem)[:, 0].sum() == pytest.approx(25.0) and np.count_nonzero(problem.sets.vertices("part", "k")) == 11 * 11  # from x = 10 on


def test_initial_states_add_up(comm):
    extra = '[[initial]]\nvelocity = [1.0, 2.0]\n[[initial]]\nvelocity_gradient = [[0.0, 3.0], [0.0, 0.0]]\norigin = [0.0, 1.0]\ndisplacement = [0.1, 0.0]\n'
    nodes, x = (problem := problem_of(comm, FEM + extra)).nodes, problem.body.mesh.points
    assert np.allclose(nodes.owned(nodes.velocity), np.stack([1.0 + 3.0 * (x[:, 1] - 1.0), np.full(len(x), 2.0)], axis=1)) and np.allclose(nodes.owned(nodes.displacement), [0.1, 0.0])


@pytest.mark.parametrize("functions", ["hat", "flat_top"])
def test_a_body_that_spins(comm, functions):
    """A turn is linear in place: flat-top functions carry it by their gradients."""
    overrides = ["fem.integration=newmark", f"fem.partition_of_unity={functions}", "time.dt=0.1"]
    problem = problem_of(comm, FEM + "[[initial]]\nangular_velocity = [2.0]\norigin = [0.0, 1.0]\n", overrides)
    nodes, x, basis = problem.nodes, problem.body.mesh.points, problem.elasticity.basis
    turn = np.array([[0.0, -2.0], [2.0, 0.0]])
    expected = basis.interpolated(problem.body.mesh, (x - [0.0, 1.0]) @ turn.T, np.broadcast_to(turn, (len(x), 2, 2)))
    assert np.allclose(nodes.owned(nodes.velocity), expected.reshape(len(x), -1))


GROUP = '[[region]]\nname = "g"\nshape = "group"\ngroup = "{group}"\n'


def test_groups_of_a_file(comm, request):
    extra = GROUP.format(group="right") + '[[load]]\ntype = "traction"\nregion = "g"\nvalue = [0.5, 2.0]\n'
    extra += GROUP.format(group="plate").replace('"g"', '"all_cells"') + '[[load]]\ntype = "force_density"\nregion = "all_cells"\nvalue = [0.0, 1.0]\n'
    text = (FILE + extra).format(file="fem/quarter_plate_4.msh")
    problem = build(parse_scene(text, str(request.path.parents[1] / "s.toml")), comm)
    mesh = problem.body.mesh
    height, volume = np.ptp(mesh.points[:, 1]), problem.stepper().view.volume.sum()
    assert forces(problem).sum(axis=0) == pytest.approx([0.5 * height, 2.0 * height + volume])
    right = np.isclose(mesh.points[:, 0], mesh.points[:, 0].max())
    assert np.array_equal(problem.sets.vertices("g", "k"), right) and problem.sets.vertices("all_cells", "k").all() and len(problem.sets.facets("g", "+x", "k")[0]) == right.sum() - 1
    with pytest.raises(SceneError, match="selects no facet with the outward normal -x"):
        build(parse_scene(text.replace('"traction"', '"traction"\nface = "-x"'), str(request.path.parents[1] / "s.toml")), comm)


FORCE = '[[load]]\nname = "push"\ntype = "{type}"\nregion = "g"\nvalue = [0.5, 2.0]\n'


@pytest.mark.parametrize("group, load, words", [
    ("rihgt", '[[probe]]\nname = "p"\nregion = "g"\nquantity = "displacement"\n', "region 'g': group = \"rihgt\"; allowed is a group of fem/quarter_plate_4.msh (bottom, hole, left, right, top, lower half, plate) (did you mean \"right\"?)"),
    ("rihgt", FORCE.format(type="traction"), "region 'g': group = \"rihgt\"; allowed is a group of"),
    ("right", FORCE.format(type="force_density"),
     "load 'push': region = \"g\", whose group \"right\" is one of facets; allowed is a region of cells: fem/quarter_plate_4.msh has lower half, plate"),
])
def test_groups_that_the_file_lacks(comm, request, group, load, words):
    """A misspelt group is the region's error, whoever refers to it; one of the wrong kind that of who does."""
    text = (FILE + GROUP.format(group=group) + load).format(file="fem/quarter_plate_4.msh")
    with pytest.raises(SceneError) as caught:
        build(parse_scene(text, str(request.path.parents[1] / "s.toml")), comm)
    assert words in str(caught.value), caught.value


@pytest.mark.parametrize("extra, words", [
    (BOX.format(name="r", lower=[0.1, 0.1], upper=[0.2, 0.2]) + '[[load]]\nname = "l"\ntype = "velocity"\nregion = "r"\nvalue = [1.0, 0.0]\n', "load 'l': region = \"r\", which selects no vertex"),
    (BOX.format(name="r", lower=[1.0, 1.0], upper=[2.0, 2.0]) + TRACTION.format(region="r", face="+x"), "which selects no facet with the outward normal +x of the mesh"),
    (BOX.format(name="r", lower=[10.0, 1.0], upper=[11.0, 2.0]) + '[[load]]\nname = "l"\ntype = "force_density"\nregion = "r"\nvalue = [1.0, 0.0]\n', "which selects no cell of the mesh"),
    ("".join(BOX.format(name=name, lower=[low, 0.0], upper=[low + 5.0, 5.0]) + f'[[load]]\ntype = "velocity"\nregion = "{name}"\nvalue = [1.0, "free"]\n'
             for name, low in (("a", 0.0), ("b", 5.0))), "another load prescribes the same component of a vertex"),
])
def test_what_only_the_mesh_shows(comm, extra, words):
    with pytest.raises(SceneError) as caught:
        problem_of(comm, FEM + extra)
    assert words in str(caught.value), caught.value
