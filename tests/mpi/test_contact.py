"""Bodies that meet, break and travel across borders of ranks, against the same run on one rank: every digit."""
import numpy as np
import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate

BULLET = """
[[body]]
name = "bullet"
material = "solid"
shape = "box"
lower = [{x}, -3.0]
upper = [{end}, 3.0]
[[region]]
name = "bullet"
shape = "box"
body = "bullet"
lower = [-100.0, -100.0]
upper = [100.0, 100.0]
[[initial]]
region = "bullet"
velocity = [0.6, 0.13]
[contact]
{contact}
"""
BALLS = """
[[impactor]]
name = "ball"
shape = "cylinder"
center = [0.3, 12.0]
radius = 5.0
velocity = [0.1, -0.5]
mass = 30.0
gravity = [0.0, -0.01]
friction = 0.3
[[impactor]]
name = "wall"
shape = "plane"
point = [14.0, 0.0]
normal = [-1.0, 0.1]
velocity = [-0.2, 0.0]
time = { function = "ramp", start = 0.0, end = 20.0 }
friction = 0.1
"""
BREAKS = "critical_stretch = 0.03"


def gathered(comm, simulation):
    """Return {name: array sorted by id} of the whole body, on every rank."""
    subdomain = simulation.problem.subdomain
    particles = subdomain.particles
    parts = {"id": particles.id[: particles.n_owned], "alive": subdomain.bonds.alive()}
    for name in ("displacement", "velocity", "force_density", "dissipated"):
        parts[name] = particles.owned(getattr(particles, name))
    whole = {name: np.concatenate(comm.allgather(values)) for name, values in parts.items()}
    order = np.argsort(whole["id"])
    return {name: values[order] for name, values in whole.items()}


def contacts(simulation):
    return simulation.stepper.conditions.interactions


def same_as_on_one_rank(comm, scene):
    """Run a scene on all ranks and on one; return the Simulation of all of them and both records after comparing every digit."""
    from mpi4py import MPI

    together, alone = Simulation(scene, comm), Simulation(scene, MPI.COMM_SELF)
    assert together.problem.dt == alone.problem.dt
    record, reference = together.run(quiet=True), alone.run(quiet=True)
    expected = gathered(MPI.COMM_SELF, alone)
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, expected[name]), name
    assert record["energies"] == reference["energies"] and record["broken_bonds"] == reference["broken_bonds"]
    for one, other in zip(contacts(together), contacts(alone)):
        if hasattr(one, "impactor"):
            for name in ("position", "velocity", "force"):  # no rank knows the force on a prescribed one: history.csv sums it up
                assert np.array_equal(getattr(one.impactor, name), getattr(other.impactor, name)), name
    return together, record


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("model", ["", 'model = "lps"\npoissons_ratio = 0.2'], ids=["pmb", "lps"])
@pytest.mark.parametrize("path, shift", [("lattice", 0.0), ("cloud", 0.0), ("cloud", 0.25)])
def test_a_bullet_that_breaks_a_plate(comm, path, shift, model):
    extra = BULLET.format(x=-26.0 + shift, end=-17.0 + shift, contact="friction = 0.2\ndamping = 0.1")
    scene = parse_scene(plate((24, 20), 3.0, kinematics="finite", material=f"{BREAKS}\n{model}", extra=extra), "t", [f"particles.path={path}", "time.end=50.0"])
    together, record = same_as_on_one_rank(comm, scene)
    assert record["broken_bonds"] > 500
    assert record["energies"]["contact_energy"] > 0 and record["energies"]["contact_loss"] > 0
    assert comm.allreduce(contacts(together)[0].ghosts) > 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("contact", ["", "[contact]\n"], ids=["impactors", "both"])
def test_impactors_free_and_prescribed(comm, contact):
    scene = parse_scene(plate((24, 12), 3.0, kinematics="finite", material=BREAKS, extra=BALLS + contact), "t", ["time.end=40.0"])
    together, record = same_as_on_one_rank(comm, scene)
    assert record["broken_bonds"] > 50 and record["energies"]["impactor_energy"] > 0


@pytest.mark.mpi(min_size=2)
def test_a_body_that_leaves_its_ranks_behind(comm):
    """A small body flies past a long one that it grazes from end to end: its few ranks meet all others, one after the other."""
    extra = BULLET.format(x=-48.0, end=-40.0, contact="friction = 0.1").replace("-3.0]", "6.4]").replace(" 3.0]", " 10.4]").replace("[0.6, 0.13]", "[0.9, -0.015]")
    scene = parse_scene(plate((70, 10), 2.0, kinematics="finite", extra=extra), "t", ["time.end=100.0"])
    together, record = same_as_on_one_rank(comm, scene)
    assert contacts(together)[0].lists_made > 50
    assert record["energies"]["contact_loss"] > 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", ["lattice", "cloud"])
def test_more_ranks_than_particles(comm, path):
    scene = parse_scene(plate((2, 1), 2.0, kinematics="finite", extra=BALLS.replace("14.0", "2.0") + "[contact]\nfriction = 0.1\n"), "t", [f"particles.path={path}", "time.end=20.0"])
    _, record = same_as_on_one_rank(comm, scene)
    assert record["particles"] == 2 and record["energies"]["contact_energy"] + record["energies"]["contact_loss"] > 0


@pytest.mark.mpi(min_size=2)
def test_history_of_impactors_has_the_same_digits(comm):
    import shutil
    import tempfile
    from pathlib import Path

    from mpi4py import MPI

    scene = parse_scene(plate((24, 12), 3.0, kinematics="finite", material=BREAKS, extra=BALLS + "[contact]\n"), "t", ["time.end=30.0", "output.frames=6"])
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    Simulation(scene, comm).run(folder / "together", quiet=True)
    Simulation(scene, MPI.COMM_SELF).run(folder / f"alone{comm.rank}", quiet=True)
    rows = [(folder / name / "history.csv").read_text() for name in ("together", f"alone{comm.rank}")]
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(folder, ignore_errors=True)
    assert rows[0] == rows[1] and len(rows[0].splitlines()) == 8 and "wall.force_x [N]" in rows[0]


@pytest.mark.mpi(min_size=2)
def test_candidates_are_all_that_is_near(comm):
    """Points scattered over ranks at random: what a rank is told of holds every point near one of its own."""
    from pdhpc.parallel.vicinity import Vicinity

    points = np.random.default_rng(0).uniform(0, 10, (300, 2))
    points = points[np.argsort(points[:, 0] + 0.5 * points[:, 1])]
    owner = np.arange(300) * comm.size // 300
    rows = np.column_stack([points, np.arange(300)])
    found, owners = Vicinity(comm).gather_near(rows[owner == comm.rank], 2, 0.7)
    mine = points[owner == comm.rank]
    near = (np.linalg.norm(points[:, None] - mine, axis=2).min(axis=1) < 0.7) & (owner != comm.rank)
    assert set(np.flatnonzero(near)) <= set(found[:, 2].astype(int)) and near.sum() > 10
    assert np.array_equal(owners, owner[found[:, 2].astype(int)]) and np.array_equal(np.lexsort((found[:, 2], owners)), np.arange(len(found)))
    assert np.array_equal(found, rows[found[:, 2].astype(int)])


@pytest.mark.mpi(min_size=2)
def test_three_dimensions(comm):
    body = '[[body]]\nname = "b"\nmaterial = "solid"\nshape = "sphere"\ncenter = [0.3, 0.2, 9.0]\nradius = 3.6\n'
    more = '[[region]]\nname = "b"\nbody = "b"\nshape = "box"\nlower = [-9.0, -9.0, 4.5]\nupper = [9.0, 9.0, 19.0]\n[[initial]]\nregion = "b"\nvelocity = [0.1, 0.0, -0.5]\n'
    more += '[contact]\nfriction = 0.2\n[[impactor]]\nname = "rod"\nshape = "cylinder"\ncenter = [0.0, 0.0, -8.0]\naxis = [0.1, 0.0, 1.0]\n'
    more += "length = 4.0\nradius = 2.5\nvelocity = [0.0, 0.0, 0.4]\nmass = 100.0\nfriction = 0.1\n"
    text = plate((10, 10, 6), 2.0, kinematics="finite", material=BREAKS, dimension="3d", extra=body + more)
    _, record = same_as_on_one_rank(comm, parse_scene(text, "t", ["time.end=14.0"]))
    assert record["broken_bonds"] > 50 and record["energies"]["contact_loss"] > 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("surface", ["none", "energy"])
def test_a_table_hits_a_coarser_lattice(comm, surface, tmp_path_factory):
    """A block of particles of side 3/4 and a horizon of its own: momentum is kept, and every digit is that of one rank."""
    path = comm.bcast(tmp_path_factory.mktemp("block") / "block.txt" if comm.rank == 0 else None)
    if comm.rank == 0:
        path.write_text("".join(f"{-20.0 + 0.75 * i} {-2.6 + 0.75 * j} 0.5625 1\n" for i in range(9) for j in range(8)))
    comm.Barrier()
    box = 'shape = "box"\nlower = [-26.0, -3.0]\nupper = [-17.0, 3.0]'
    extra = BULLET.format(x=-26.0, end=-17.0, contact="friction = 0.2").replace(box, f'shape = "table"\nfile = "{path}"\nhorizon = 2.5')
    options = ["particles.volume_correction=none", f"particles.surface_correction={surface}", "time.end=25.0"]
    scene = parse_scene(plate((24, 20), 3.0, kinematics="finite", material=BREAKS, extra=extra), "t", options)
    together, record = same_as_on_one_rank(comm, scene)
    assert record["energies"]["contact_energy"] > 0 and record["energies"]["contact_loss"] > 0 and record["broken_bonds"] > 20
    whole = gathered(comm, together)
    volume = np.where(np.isin(whole["id"], np.sort(whole["id"])[-72:]), 0.5625, 1.0)
    momentum = volume @ whole["velocity"]
    assert np.abs(momentum - 72 * 0.5625 * np.array([0.6, 0.13])).max() < 1e-11
