"""Bodies from files in a scene: what they make, and what is wrong with them, in one sentence."""
from pathlib import Path

import numpy as np
import pytest

from pdhpc.geometry.points import PointBody
from pdhpc.kernels.family import VARIED
from pdhpc.scene.body import make_body, select
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene, read_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.bodies import cracked, write_cells, write_table

COUNTS = (12, 6)
GMSH = Path(__file__).resolve().parents[1] / "fem" / "quarter_plate_4.msh"
NONE = ["particles.volume_correction=none"]


@pytest.fixture
def alone():
    from mpi4py import MPI

    return MPI.COMM_SELF


@pytest.fixture
def folder(tmp_path):
    write_table(tmp_path / "points.txt", cracked(COUNTS))
    write_cells(tmp_path / "cells.inp", COUNTS)
    return tmp_path


def scene_of(folder, body, right=None, overrides=(), extra=""):
    """Return the scene of a body whose lines name a file in the folder, from a scene file there: paths are relative to it."""
    (folder / "scene.toml").write_text(cracked(COUNTS, body, right) + extra)
    return read_scene(folder / "scene.toml", overrides)


TABLE, MESH = 'shape = "table"\nfile = "points.txt"\n', 'shape = "mesh"\nfile = "cells.inp"\n'
EVERYWHERE = np.full(2, -np.inf), np.full(2, np.inf)


@pytest.mark.parametrize("lines", [TABLE, MESH])
def test_the_particles_are_those_of_the_lattice(folder, alone, lines):
    expected = make_body(parse_scene(cracked(COUNTS), "t")).lattices[0].points_in(*EVERYWHERE)
    body = make_body(scene_of(folder, lines, overrides=["particles.path=auto"]), alone)
    found = body.lattices[0].points_in(*EVERYWHERE)
    assert np.array_equal(found[0], expected[0]) and np.allclose(found[1], expected[1], rtol=0, atol=1e-14)
    assert isinstance(body.lattices[0], PointBody) and body.path.startswith("cloud: body 'body' comes from a file") and body.volumes == pytest.approx([1.0])


def test_a_mesh_has_the_plate_s_thickness(folder, alone):
    scene = scene_of(folder, MESH, overrides=["particles.thickness=0.25"])
    body = make_body(scene, alone).lattices[0]
    assert body.volume == pytest.approx(0.25) and body.sizes == pytest.approx((1.0, 1.0, 1.0))


def test_bodies_share_a_file_and_keep_its_rows(folder, alone):
    two = TABLE + 'block = 2\n[[body]]\nname = "rest"\nmaterial = "solid"\n' + TABLE + "block = 1\n"
    body = make_body(scene_of(folder, two), alone)
    first, second = body.lattices
    assert (first.count, second.count) == (2 * COUNTS[1], 10 * COUNTS[1]) and second.first_id == first.last_id == 72
    assert first.id.tolist() == list(range(60, 72)) and second.id.tolist() == list(range(72, 132))
    assert body.number_of(np.array([71, 72])).tolist() == [0, 1] and first.lower.tolist() == [10.5, 0.5]


def test_rows_that_no_body_takes_are_told(folder, alone):
    both = TABLE + 'block = 2\n[[body]]\nname = "rest"\nmaterial = "solid"\n' + TABLE + "block = 1\n"
    remarks = [make_body(scene_of(folder, lines), alone).remarks for lines in (TABLE + "block = 1\n", both, TABLE)]
    assert remarks == [("points.txt: rows of block 2 are in no body",), (), ()]


@pytest.mark.parametrize("lines, group", [(TABLE, "2"), (MESH, "right")])
def test_regions_of_groups(folder, alone, lines, group):
    scene = scene_of(folder, lines, f'shape = "group"\ngroup = "{group}"')
    body = make_body(scene, alone)
    ids, points = body.lattices[0].points_in(*EVERYWHERE)
    inside = select(scene, body, "right", points, np.zeros(len(ids), int), ids)
    assert np.array_equal(inside, points[:, 0] > 10)


def test_cells_that_touch_a_line_of_gmsh(alone):
    right = f'shape = "group"\ngroup = "bottom"'
    text = cracked((3, 3), f'shape = "mesh"\nfile = "{GMSH}"', right)
    scene = parse_scene(text, "t", [*NONE, "particles.horizon=4.0"])
    body = make_body(scene, alone)
    ids, points = body.lattices[0].points_in(*EVERYWHERE)
    inside = select(scene, body, "right", points, np.zeros(4, int), ids)
    assert inside.sum() == 2 and points[inside, 1].max() < points[~inside, 1].min()


@pytest.mark.parametrize("lines, overrides, words", [
    ('shape = "table"\nfile = "none.txt"\n', [], ["body 'body': file = \"none.txt\" (there is no table", "from the folder of the scene"]),
    ('shape = "mesh"\nfile = "none.msh"\n', [], ["there is no mesh"]),
    ('shape = "mesh"\nfile = "points.txt"\n', [], ["cannot be read"]),
    ('shape = "table"\nfile = "cells.inp"\n', [], ["1 column in line 1; in 2D a row has 4: x, y, volume, block"]),
    (TABLE + "block = 3\n", [], ["block = \"3\"", "a block of points.txt (1, 2)"]),
    (MESH + 'group = "rihgt"\n', [], ["group = \"rihgt\"", "a group of cells of cells.inp (right)", 'did you mean "right"']),
    (TABLE, ["particles.spacing=0.8"], ["particles.volume_correction", "1 to 1 m in size", '"none"']),
    (TABLE, [*NONE, "particles.spacing=0.5", "particles.horizon=1.9"], ["particles.horizon = 1.9", "at least twice the mean size", "2 m"]),
])
def test_each_error_in_one_sentence(folder, alone, lines, overrides, words):
    with pytest.raises(SceneError) as caught:
        make_body(scene_of(folder, lines, overrides=overrides), alone)
    text = str(caught.value)
    assert "allowed" in text and all(word in text for word in words) and "\n" not in text, text


def test_a_mesh_of_another_dimension_and_a_group_of_points(folder, alone):
    write_cells(folder / "cells.inp", (2, 2, 2))
    with pytest.raises(SceneError, match='cells of 3 dimensions; dimension = "plane_stress" asks for 2'):
        make_body(scene_of(folder, MESH), alone)
    text = cracked((3, 3), f'shape = "mesh"\nfile = "{GMSH}"\ngroup = "bottom"')
    with pytest.raises(SceneError, match=r'"bottom", which is a group of points or facets; allowed is a group of cells of .* \(lower half, plate\)'):
        make_body(parse_scene(text, "t"), alone)


def test_a_region_of_no_file(folder, alone):
    with pytest.raises(SceneError, match=r"region 'right': group = \"front\"; allowed is a group of the bodies' files \(right\)"):
        make_body(scene_of(folder, MESH, 'shape = "group"\ngroup = "front"'), alone)


OTHER = '[[body]]\nname = "other"\nmaterial = "solid"\nshape = "box"\nlower = {}\nupper = {}\n'


@pytest.mark.parametrize("lower, words", [
    ([0.0, 0.0], "row 1 of body 'body' and cell 1 of body 'other' at the same place"),
    ([0.1, 0.0], "only 0.1 m apart, 0.1 of their mean size"),
    ([0.5, 0.5], "times the volume of its ball"),
    ([11.0, 0.5], "row 68 of body 'body' within body 'other'; allowed is bodies that do not overlap"),  # by a layer of cells, between them: no family is too full
    ([11.5, 0.0], "12 of 12 particles that face another body have one of it nearer than 0.75 times"),  # by half a layer: centres lie on its face
    ([12.0, 0.0], None),
    ([12.5, 0.25], None),
])
def test_overlapping_bodies(folder, alone, lower, words):
    box = OTHER.format(lower, [lower[0] + 12.0, lower[1] + 6.0])
    scene = scene_of(folder, TABLE + box, 'shape = "box"\nlower = [10.0, 0.0]\nupper = [12.0, 6.0]')
    if words is None:
        assert build(scene, alone).subdomain.particles.n_owned == 144
        return
    with pytest.raises(SceneError, match=words):
        build(scene, alone)


def test_a_point_given_twice(folder, alone):
    text = (folder / "points.txt").read_text()
    (folder / "points.txt").write_text(text + text.splitlines()[8] + "\n")
    with pytest.raises(SceneError, match="row 8 of body 'body' and row 73 of body 'body' at the same place"):
        build(scene_of(folder, TABLE), alone)


def test_each_particle_has_the_volume_of_its_row(folder, alone):
    rows = [line.split() for line in (folder / "points.txt").read_text().splitlines()[1:]]
    volume = 1.0 + 1e-3 * np.arange(len(rows))
    (folder / "points.txt").write_text("".join(f"{x} {y} {v!r} {block}\n" for (x, y, _, block), v in zip(rows, volume.tolist())))
    problem = build(scene_of(folder, TABLE + "block = 1\n", 'shape = "box"\nlower = [8.0, 0.0]\nupper = [10.0, 6.0]'), alone)
    particles = problem.subdomain.particles
    assert np.array_equal(particles.volume, volume[:60]) and np.array_equal(particles.id, np.arange(60))
    assert problem.body.volumes == pytest.approx([volume[:60].mean()])


def test_bonds_of_a_group_may_be_barred_from_failing(folder, alone):
    problem = build(scene_of(folder, MESH, 'shape = "group"\ngroup = "right"', extra='[damage]\nno_fail = ["right"]\n'), alone)
    subdomain, right = problem.subdomain, problem.subdomain.places()[:, 0] > 10
    assert len(np.unique(subdomain.particles.block[right])) == len(np.unique(subdomain.particles.block[~right])) == 1
    stepper = problem.stepper()
    for _ in range(problem.n_steps):
        stepper.advance()
    assert stepper.broken == 0 or np.all(subdomain.bonds.damage()[right] == 0.0)


def test_a_fine_region_of_particles_of_several_volumes(folder, alone):
    """With one fine step in one of the rest the coupled run is the undivided one; rows of the overlap have weights and volumes of their own."""
    rows = [line.split() for line in (folder / "points.txt").read_text().splitlines()[1:]]
    (folder / "points.txt").write_text("".join(f"{x} {y} {0.9 + 0.2 * k / len(rows)!r} {block}\n" for k, (x, y, _, block) in enumerate(rows)))
    fine = '[fine]\nshape = "box"\nlower = [8.0, 0.0]\nupper = [12.0, 6.0]\nstep_ratio = 1\ninterface = "exact"\n'
    options = ["particles.volume_correction=none", "particles.kinematics=linear", "material.solid.critical_stretch=1.0", "time.dt=0.4", "time.end=4.0"]
    ends = []
    for extra in ("", fine):
        problem = build(scene_of(folder, TABLE, overrides=options, right='shape = "group"\ngroup = "2"', extra=extra), alone)
        assert (problem.subdomain.points.row_block == VARIED).sum() > 20
        stepper = problem.stepper()
        for _ in range(problem.n_steps):
            stepper.advance()
        view = stepper.view
        view.prepare()
        ends.append(view.field("displacement")[np.argsort(view.ids)])
    assert np.abs(ends[0] - ends[1]).max() < 1e-11 * np.abs(ends[0]).max()
