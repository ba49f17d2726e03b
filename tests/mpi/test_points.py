"""Bodies from files on several ranks: the same bits as the lattice on one, the same sentences for what is wrong."""
import meshio
import numpy as np
import pytest

from pdhpc.parallel.partition import bisect
from pdhpc.parallel.travel import send_rows, share_pieces
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.simulation import Simulation
from pdhpc.study.verify.bodies import cracked, write_cells, write_table
from tests.mpi.test_simulation import gathered

COUNTS = (24, 12)
WIDE = '[[body]]\nname = "wide"\nmaterial = "solid"\nshape = "box"\nlower = [24.0, 0.0]\nupper = [30.0, 12.0]\nhorizon = 4.0\n'


@pytest.fixture
def folder(comm, tmp_path_factory):
    """A folder with points.txt and cells.inp that coincide with the lattice of COUNTS, on every rank."""
    path = None
    if comm.rank == 0:
        path = tmp_path_factory.mktemp("bodies")
        write_table(path / "points.txt", cracked(COUNTS))
        write_cells(path / "cells.inp", COUNTS)
    return comm.bcast(path)


def lines(folder, kind):
    return f'shape = "table"\nfile = "{folder}/points.txt"' if kind == "table" else f'shape = "mesh"\nfile = "{folder}/cells.inp"'


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("options, extra", [
    ([], ""), (["material.solid.model=lps", "material.solid.poissons_ratio=0.3"], ""), (["particles.surface_correction=energy", "body.body.horizon=2.5"], WIDE),
    (["particles.surface_correction=volume", "material.solid.stretch_softening=0.25"], ""), (["particles.influence=conical"], WIDE),
], ids=["pmb", "lps", "energy", "volume", "conical"])
def test_a_table_gives_the_bits_of_the_lattice(comm, folder, options, extra):
    from mpi4py import MPI

    alone = Simulation(parse_scene(cracked(COUNTS) + extra, "lattice", options), MPI.COMM_SELF)
    together = Simulation(parse_scene(cracked(COUNTS, lines(folder, "table"), 'shape = "group"\ngroup = "2"') + extra, "table", options), comm)
    assert together.problem.dt == alone.problem.dt
    reference, record = alone.run(quiet=True), together.run(quiet=True)
    expected = gathered(MPI.COMM_SELF, alone)
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, expected[name]), name
    assert record["broken_bonds"] == reference["broken_bonds"] > 50 and record["energies"] == reference["energies"]
    held = np.array(comm.allgather(len(together.problem.parts[0].body.lattices[0].id)))
    assert held.max() < np.prod(COUNTS), "no rank holds all points"
    assert record["bond_imbalance"] < 1.1


@pytest.mark.mpi(min_size=2)
def test_a_mesh_of_several_sizes_has_the_same_bits_on_any_number_of_ranks(comm, tmp_path_factory):
    """Squares that grow along x, halved into triangles above; a traction on a point set's cells needs the shadow of all ranks."""
    from mpi4py import MPI

    path = None
    if comm.rank == 0:
        path = tmp_path_factory.mktemp("mesh") / "graded.inp"
        x = np.cumsum([0.0] + [0.8 + 0.02 * k for k in range(24)])
        number = np.arange(25 * 13).reshape(25, 13)
        corners = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
        quads, rest = corners[:, :6].reshape(-1, 4), corners[:, 6:].reshape(-1, 4)
        points = np.array([[a, b, 0.0] for a in x for b in range(13)])
        meshio.Mesh(points, [("quad", quads), ("triangle", np.concatenate([rest[:, :3], rest[:, [0, 2, 3]]]))], point_sets={"end": number[-1]}).write(path)
    path = comm.bcast(path)
    traction = '[[load]]\ntype = "traction"\nregion = "end"\nface = "+x"\nvalue = [1e-3, 0.0]\n[[region]]\nname = "end"\nshape = "group"\ngroup = "end"\n'
    text = cracked((24, 12), f'shape = "mesh"\nfile = "{path}"', 'shape = "box"\nlower = [22.0, 0.0]\nupper = [40.0, 12.0]') + traction
    scene = parse_scene(text, "graded", ["particles.volume_correction=none"])
    alone, together = Simulation(scene, MPI.COMM_SELF), Simulation(scene, comm)
    reference, record = alone.run(quiet=True), together.run(quiet=True)
    expected = gathered(MPI.COMM_SELF, alone)
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, expected[name]), name
    assert record["energies"] == reference["energies"] and record["energies"]["external_work"] != 0 and record["broken_bonds"] > 50
    assert record["particles"] == 24 * 6 * 3


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("correction", ["none", "linear"])
def test_bodies_of_two_spacings_have_the_same_bits_on_any_number_of_ranks(comm, correction):
    from mpi4py import MPI

    finer = '[[body]]\nname = "finer"\nmaterial = "solid"\nshape = "box"\nlower = [24.0, 0.0]\nupper = [30.0, 12.0]\nspacing = 0.75\n'
    text = cracked(COUNTS, right='shape = "box"\nlower = [26.0, 0.0]\nupper = [30.0, 12.0]') + finer
    scene = parse_scene(text, "t", [f"particles.volume_correction={correction}"])
    alone, together = Simulation(scene, MPI.COMM_SELF), Simulation(scene, comm)
    reference, record = alone.run(quiet=True), together.run(quiet=True)
    expected = gathered(MPI.COMM_SELF, alone)
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, expected[name]), name
    assert record["energies"] == reference["energies"] and record["particles"] == 24 * 12 + 8 * 16 and record["broken_bonds"] > 50


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("kind", ["table", "mesh"])
def test_a_fine_region_takes_particles_of_files(comm, folder, kind):
    """The coupled run of a file's particles on all ranks is that of the lattice's cloud on one, but for sums over ranks in the interface."""
    from mpi4py import MPI

    fine = '[fine]\nshape = "box"\nlower = [16.0, 0.0]\nupper = [24.0, 12.0]\nstep_ratio = 4\n'
    options = ["time.end=6.0", "time.dt=0.4", "material.solid.critical_stretch=1.0", "particles.kinematics=linear"]
    alone = Simulation(parse_scene(cracked(COUNTS) + fine, "lattice", options), MPI.COMM_SELF)
    together = Simulation(parse_scene(cracked(COUNTS, lines(folder, kind), f'shape = "group"\ngroup = "{2 if kind == "table" else "right"}"') + fine, kind, options), comm)
    runs = []
    for simulation, ranks in ((alone, MPI.COMM_SELF), (together, comm)):
        simulation.run(quiet=True)
        view = simulation.stepper.view
        view.prepare()
        ids, values = (np.concatenate(ranks.allgather(each)) for each in (view.ids, view.field("displacement")))
        runs.append(values[np.argsort(ids)])
    assert len(runs[0]) == len(runs[1]) == 288 and np.abs(runs[0] - runs[1]).max() < 1e-9 * np.abs(runs[0]).max()


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("change, words", [
    (lambda rows: rows[:40] + ["nan 1.0 1.0 1"] + rows[40:], "not finite in line 41"), (lambda rows: [], "has no rows"),
    (lambda rows: rows + [rows[9]], "row 9 of body 'body' and row 289 of body 'body' at the same place"),
    (lambda rows: rows, "only 0.1 m apart, 0.1 of their mean size"),
])
def test_every_rank_says_what_is_wrong(comm, folder, change, words):
    if comm.rank == 0:
        path = folder / "points.txt"
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    box = '\n[[body]]\nname = "other"\nmaterial = "solid"\nshape = "box"\nlower = [30.0, 0.0]\nupper = [40.0, 4.0]\n'
    if "mean size" in words:
        box = box.replace("[30.0, 0.0]", "[12.1, 6.0]").replace("[40.0, 4.0]", "[13.1, 7.0]")
    comm.Barrier()
    with pytest.raises(SceneError, match=words) as caught:
        build(parse_scene(cracked(COUNTS, lines(folder, "table") + box, 'shape = "group"\ngroup = "2"'), "t"), comm)
    assert len(set(comm.allgather(str(caught.value)))) == 1


@pytest.mark.mpi(min_size=2)
def test_pieces_are_dealt_out_evenly(comm):
    whole = np.arange(26.0).reshape(13, 2)
    pieces = iter([(whole[:8], np.arange(8)), (whole[8:], np.arange(8, 13))]) if comm.rank == 0 else None
    mine = [(first, *arrays) for first, arrays in share_pieces(comm, pieces)]
    for first, points, numbers in mine:
        assert np.array_equal(numbers, first + np.arange(len(numbers))) and np.array_equal(points, whole[numbers])
    assert sorted(np.concatenate(comm.allgather(np.concatenate([each[2] for each in mine]))).tolist()) == list(range(13))
    assert max(abs(len(each[2]) - size / comm.size) for each, size in zip(mine, (8, 5))) < 1


@pytest.mark.mpi(min_size=2)
def test_points_travel_to_every_box_in_reach(comm):
    points = np.random.default_rng(comm.rank).random((50 + comm.rank, 3))
    number = 100 * comm.rank + np.arange(len(points))
    partition = bisect(comm, points, np.ones(len(points), np.int64))
    row, rank = partition.ranks_near(points, 0.1)
    here, ids = send_rows(comm, rank, [points[row], number[row]])
    every, every_id = np.concatenate(comm.allgather(points)), np.concatenate(comm.allgather(number))
    lower, upper = partition.box(comm.rank, 3)
    expected = np.all((every >= lower - 0.1) & (every < upper + 0.1), axis=1)
    assert sorted(ids.tolist()) == sorted(every_id[expected].tolist()) and len(here) < len(every)
    assert np.array_equal(here[np.argsort(ids)], every[expected][np.argsort(every_id[expected])])
